//! `sublevel scene`.

use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;

use super::files::write_atomically;
use super::numbers::{Numbers, PoseNumbers};
use super::scene_picture::{RobotState, picture};
use crate::body::BodyId;
use crate::client::{Client, ClientOptions, ListedScene, RobotPlacement, SceneState};
use crate::measure::Pose;
use crate::scene::{NamedJointValues, Placement, RobotId, Subject, Update};

/// Make, show and edit the scenes of a running server
///
/// A scene is a set of named objects; an object is a stored body at a pose. A pose is written
/// X,Y,Z in metres, or X,Y,Z,QX,QY,QZ,QW with a unit quaternion.
///
/// Examples:
///   sublevel scene create cell
///   sublevel scene put cell table --body 3f2a...  --pose 0,0,0.7
///   sublevel scene move cell table --pose 0.1,0,0.7
///   sublevel scene place cell arm --robot 9c41... --base 0,0,0.7
///   sublevel scene show cell
///   sublevel scene show cell --svg cell.svg --state arm=0,-0.8,0,-2.4,0,1.6,0.8
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct SceneArgs {
    #[command(subcommand)]
    command: SceneCommand,
    /// Address of the server
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:50051", global = true)]
    server: String,
    /// Print JSON instead of a table
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, clap::Subcommand)]
enum SceneCommand {
    /// List all scenes and forks
    List,
    /// Create an empty scene
    Create { scene: String },
    /// Show the objects of a scene, as a table and as a picture
    Show {
        scene: String,
        /// Write its silhouettes, seen along the three axes
        #[arg(long, value_name = "OUT.svg")]
        svg: Option<PathBuf>,
        /// Draw a robot of the scene at these values of all its joints, radians or metres, and mark
        /// where it is nearest to what is not of it
        ///
        /// Up to four times, each in a colour of its own: several states of a robot, or of several,
        /// which keep a state until their next one. The states are set in a fork of the scene,
        /// which is removed again. Half-spaces have no end and are not drawn.
        #[arg(long = "state", value_name = "ROBOT=V,V,...", requires = "svg")]
        states: Vec<RobotState>,
    },
    /// Place a robot, or replace it
    Place {
        scene: String,
        /// Name of the robot in the scene; its links are objects NAME/LINK
        name: String,
        /// Id of a stored robot, as `sublevel robot --server` prints it
        #[arg(long, value_name = "ID")]
        robot: RobotId,
        /// Where its root link stands
        #[arg(long, value_name = "POSE", allow_hyphen_values = true, default_value = "0,0,0")]
        base: PoseNumbers,
        /// Values of all its joints, radians or metres [default: 0, or the limit nearest to it]
        #[arg(long, value_name = "V,V,...", allow_hyphen_values = true)]
        joints: Option<Numbers>,
    },
    /// Add an object, or replace it
    Put {
        scene: String,
        object: String,
        /// Id of a stored body, as `sublevel push` prints it
        #[arg(long, value_name = "ID")]
        body: BodyId,
        /// Where it stands
        #[arg(long, value_name = "POSE", allow_hyphen_values = true, default_value = "0,0,0")]
        pose: PoseNumbers,
        /// Label that puts objects together
        #[arg(long, value_name = "NAME", default_value = "")]
        group: String,
        /// Metres that are added to every margin
        #[arg(long, value_name = "METRES", allow_hyphen_values = true)]
        padding: Option<f64>,
    },
    /// Move an object
    Move {
        scene: String,
        object: String,
        /// Where it stands now
        #[arg(long, value_name = "POSE", allow_hyphen_values = true)]
        pose: PoseNumbers,
    },
    /// Remove an object
    Remove { scene: String, object: String },
    /// Let two objects touch
    Allow { scene: String, a: String, b: String },
    /// Do not let two objects touch any more
    Forbid { scene: String, a: String, b: String },
    /// Let an object be held by another, where it is
    Attach { scene: String, object: String, to: String },
    /// Let an object go, where it is
    Detach { scene: String, object: String },
    /// Copy a scene in constant time
    Fork { scene: String, fork: String },
    /// Make the content of a fork the next revision of its parent
    Commit { fork: String },
    /// Delete a scene or fork
    Delete { scene: String },
}

/// Does what is asked for and prints what is there then.
///
/// # Errors
/// What the server refuses, and servers that do not answer.
pub(super) fn run(args: &SceneArgs) -> Result<(), Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let said = runtime.block_on(execute(args))?;
    io::stdout().lock().write_all(said.as_bytes())?;
    Ok(())
}

async fn execute(args: &SceneArgs) -> Result<String, Box<dyn Error>> {
    let client = Client::connect_with(&args.server, &ClientOptions::from_environment()).await?;
    let revision = match &args.command {
        SceneCommand::List => return Ok(list(&client.list_scenes().await?, args.json)?),
        SceneCommand::Show { scene, svg, states } => {
            if let Some(path) = svg {
                write_atomically(path, &picture(&client, scene, states).await?)?;
            }
            return Ok(show(&client.scene(scene).await?, args.json)?);
        }
        SceneCommand::Place { scene, name, robot, base, joints } => {
            let values = joints.clone().map(|Numbers(values)| values).unwrap_or_default();
            let joints = NamedJointValues { joints: Vec::new(), values };
            let placement = RobotPlacement { name: name.as_str().into(), robot: *robot, base: base.0, joints };
            client.place_robot(scene, &placement).await?
        }
        SceneCommand::Create { scene } => client.create_scene(scene).await?,
        SceneCommand::Fork { scene, fork } => client.fork_scene(scene, fork).await?,
        SceneCommand::Commit { fork } => client.commit_fork(fork).await?,
        SceneCommand::Delete { scene } => {
            client.delete_scene(scene).await?;
            return Ok(if args.json { "{}\n".into() } else { format!("deleted {scene}\n") });
        }
        SceneCommand::Move { scene, object, pose } => client.set_poses(scene, [(object.as_str(), pose.0)]).await?,
        SceneCommand::Attach { scene, object, to } => client.attach(scene, object, to).await?,
        SceneCommand::Put { scene, object, body, pose, group, padding } => {
            let placement = Placement {
                name: object.as_str().into(),
                body: *body,
                pose: Some(pose.0),
                group: group.as_str().into(),
                padding_m: *padding,
                attachment: None,
            };
            client.update_scene(scene, &Update { upserts: vec![placement], ..Update::default() }).await?
        }
        SceneCommand::Remove { scene, object } => {
            client.update_scene(scene, &Update { removals: vec![object.as_str().into()], ..Update::default() }).await?
        }
        SceneCommand::Allow { scene, a, b } => {
            client.update_scene(scene, &Update { allow: vec![objects(a, b)], ..Update::default() }).await?
        }
        SceneCommand::Forbid { scene, a, b } => {
            client.update_scene(scene, &Update { forbid: vec![objects(a, b)], ..Update::default() }).await?
        }
        SceneCommand::Detach { scene, object } => {
            client.update_scene(scene, &Update { detach: vec![object.as_str().into()], ..Update::default() }).await?
        }
    };
    Ok(if args.json { format!("{{\"revision\": {revision}}}\n") } else { format!("revision {revision}\n") })
}

fn objects(a: &str, b: &str) -> (Subject, Subject) {
    (Subject::Object(a.into()), Subject::Object(b.into()))
}

fn list(scenes: &[ListedScene], json: bool) -> Result<String, serde_json::Error> {
    let parent = |scene: &ListedScene| scene.parent.as_ref().map(|(name, _)| name.clone()).unwrap_or_default();
    if json {
        let rows: Vec<_> = scenes
            .iter()
            .map(|scene| {
                serde_json::json!({
                    "name": scene.name, "revision": scene.revision, "objects": scene.objects,
                    "parent": parent(scene),
                })
            })
            .collect();
        return Ok(serde_json::to_string_pretty(&rows)? + "\n");
    }
    let width = scenes.iter().map(|scene| scene.name.chars().count()).max().unwrap_or(0).max(5);
    let mut text = format!("{:width$}  objects  revision  fork of\n", "scene");
    for scene in scenes {
        let ListedScene { name, revision, objects, .. } = scene;
        text += format!("{name:width$}  {objects:>7}  {revision:>8}  {}", parent(scene)).trim_end();
        text.push('\n');
    }
    Ok(text)
}

fn show(scene: &SceneState, json: bool) -> Result<String, serde_json::Error> {
    let numbers = |object: &Placement| -> Vec<f64> {
        // What is read has its world pose.
        let pose = object.pose.unwrap_or(Pose::identity());
        pose.translation().iter().chain(pose.rotation().coords.iter()).copied().collect()
    };
    if json {
        let objects: Vec<_> = scene
            .objects
            .values()
            .map(|object| {
                serde_json::json!({
                    "name": &*object.name, "body": object.body.to_string(), "pose": numbers(object),
                    "group": &*object.group, "padding_m": object.padding_m,
                    "held_by": object.attachment.as_ref().map(|held| &*held.to),
                })
            })
            .collect();
        let scene = serde_json::json!({ "revision": scene.revision, "objects": objects });
        return Ok(serde_json::to_string_pretty(&scene)? + "\n");
    }
    let width = scene.objects.keys().map(|name| name.chars().count()).max().unwrap_or(0).max(6);
    let mut text =
        format!("revision {}\n{:width$}  body          pose (m, quaternion x y z w)\n", scene.revision, "object");
    for (name, object) in &scene.objects {
        let pose: Vec<String> = numbers(object).iter().map(|number| format!("{number:.4}")).collect();
        let short: String = object.body.to_string().chars().take(12).collect();
        text += &format!("{name:width$}  {short}  {}", pose.join(" "));
        if !object.group.is_empty() {
            text += &format!("  group {}", object.group);
        }
        if let Some(held) = &object.attachment {
            text += &format!("  held by {}", held.to);
        }
        text.push('\n');
    }
    let name = |subject: &Subject| match subject {
        Subject::Object(name) => name.to_string(),
        Subject::Group(name) => format!("group {name}"),
    };
    for (a, b) in &scene.allowed_pairs {
        text += &format!("may touch: {} and {}\n", name(a), name(b));
    }
    Ok(text)
}
