//! `sublevel scene`.

use std::error::Error;
use std::io::{self, Write};
use std::str::FromStr;

use nalgebra::{Vector3, Vector4};

use crate::body::BodyId;
use crate::client::{Client, ClientError, SceneState};
use crate::measure::Pose;
use crate::service::proto::{self, SceneSummary, UpdateSceneRequest, subject};

/// Make, show and edit the scenes of a running server
///
/// A scene is a set of named objects; an object is a stored body at a pose. A pose is written
/// X,Y,Z in metres, or X,Y,Z,QX,QY,QZ,QW with a unit quaternion.
///
/// Examples:
///   sublevel scene create cell
///   sublevel scene put cell table --body 3f2a...  --pose 0,0,0.7
///   sublevel scene move cell table --pose 0.1,0,0.7
///   sublevel scene show cell
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
    /// Show the objects of a scene
    Show { scene: String },
    /// Add an object, or replace it
    Put {
        scene: String,
        object: String,
        /// Id of a stored body, as `sublevel push` prints it
        #[arg(long, value_name = "ID")]
        body: BodyId,
        /// Where it stands
        #[arg(long, value_name = "POSE", allow_hyphen_values = true, default_value = "0,0,0")]
        pose: PoseArg,
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
        pose: PoseArg,
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
    /// Make what a fork holds the next revision of its parent
    Commit { fork: String },
    /// Delete a scene or fork
    Delete { scene: String },
}

/// A pose of the command line.
#[derive(Clone, Copy, Debug)]
struct PoseArg(Pose);

impl FromStr for PoseArg {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Vec<f64> = text
            .split(',')
            .map(|number| number.trim().parse().map_err(|_| format!("\"{number}\" is no number")))
            .collect::<Result<_, _>>()?;
        let (translation, quaternion) = match numbers[..] {
            [x, y, z] => (Vector3::new(x, y, z), Vector4::new(0.0, 0.0, 0.0, 1.0)),
            [x, y, z, i, j, k, w] => (Vector3::new(x, y, z), Vector4::new(i, j, k, w)),
            _ => return Err(format!("{} numbers; give X,Y,Z or X,Y,Z,QX,QY,QZ,QW", numbers.len())),
        };
        Pose::from_quaternion(translation, quaternion.into()).map(Self).map_err(|error| error.to_string())
    }
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
    let client = Client::connect(&args.server).await?;
    let revision = match &args.command {
        SceneCommand::List => return Ok(list(&client.list_scenes().await?, args.json)?),
        SceneCommand::Show { scene } => return Ok(show(&client.scene(scene).await?, args.json)?),
        SceneCommand::Create { scene } => client.create_scene(scene).await?,
        SceneCommand::Fork { scene, fork } => client.fork_scene(scene, fork).await?,
        SceneCommand::Commit { fork } => client.commit_fork(fork).await?,
        SceneCommand::Delete { scene } => {
            client.delete_scene(scene).await?;
            return Ok(if args.json { "{}\n".into() } else { format!("deleted {scene}\n") });
        }
        SceneCommand::Move { scene, object, pose } => client.set_poses(scene, [(object.as_str(), pose.0)]).await?,
        SceneCommand::Attach { scene, object, to } => client.attach(scene, object, to).await?,
        SceneCommand::Put { .. }
        | SceneCommand::Remove { .. }
        | SceneCommand::Allow { .. }
        | SceneCommand::Forbid { .. }
        | SceneCommand::Detach { .. } => edit(&client, &args.command).await?,
    };
    Ok(if args.json { format!("{{\"revision\": {revision}}}\n") } else { format!("revision {revision}\n") })
}

async fn edit(client: &Client, command: &SceneCommand) -> Result<u64, ClientError> {
    let of = |scene: &String| UpdateSceneRequest { scene: scene.clone(), ..Default::default() };
    let pair = |a: &String, b: &String| proto::SubjectPair { a: Some(object(a)), b: Some(object(b)) };
    let update = match command {
        SceneCommand::Put { scene, object, body, pose, group, padding } => {
            let object = proto::Object {
                name: object.clone(),
                body_id: body.to_string(),
                pose: Some(pose_message(&pose.0)),
                group: group.clone(),
                padding_m: *padding,
                attachment: None,
            };
            UpdateSceneRequest { upsert_objects: vec![object], ..of(scene) }
        }
        SceneCommand::Remove { scene, object } => {
            UpdateSceneRequest { remove_objects: vec![object.clone()], ..of(scene) }
        }
        SceneCommand::Allow { scene, a, b } => UpdateSceneRequest { allow_pairs: vec![pair(a, b)], ..of(scene) },
        SceneCommand::Forbid { scene, a, b } => UpdateSceneRequest { forbid_pairs: vec![pair(a, b)], ..of(scene) },
        SceneCommand::Detach { scene, object } => UpdateSceneRequest { detach: vec![object.clone()], ..of(scene) },
        _ => return Err(ClientError::Unexpected("no edit")),
    };
    client.update_scene(update).await
}

fn object(name: &str) -> proto::Subject {
    proto::Subject { subject: Some(subject::Subject::Object(name.into())) }
}

fn pose_message(pose: &Pose) -> proto::Pose {
    let (t, q) = (pose.translation(), pose.rotation().coords);
    proto::Pose {
        translation_m: Some(proto::Vector3 { x: t.x, y: t.y, z: t.z }),
        rotation: Some(proto::Quaternion { x: q.x, y: q.y, z: q.z, w: q.w }),
    }
}

fn list(scenes: &[SceneSummary], json: bool) -> Result<String, serde_json::Error> {
    if json {
        let rows: Vec<_> = scenes
            .iter()
            .map(|scene| {
                serde_json::json!({
                    "name": scene.name, "revision": scene.revision, "objects": scene.object_count,
                    "parent": scene.parent,
                })
            })
            .collect();
        return Ok(serde_json::to_string_pretty(&rows)? + "\n");
    }
    let width = scenes.iter().map(|scene| scene.name.chars().count()).max().unwrap_or(0).max(5);
    let mut text = format!("{:width$}  objects  revision  fork of\n", "scene");
    for SceneSummary { name, revision, object_count, parent, .. } in scenes {
        text += format!("{name:width$}  {object_count:>7}  {revision:>8}  {parent}").trim_end();
        text.push('\n');
    }
    Ok(text)
}

fn show(scene: &SceneState, json: bool) -> Result<String, serde_json::Error> {
    let numbers = |object: &proto::Object| -> Vec<f64> {
        let pose = object.pose.unwrap_or_default();
        let (t, q) = (pose.translation_m.unwrap_or_default(), pose.rotation.unwrap_or_default());
        vec![t.x, t.y, t.z, q.x, q.y, q.z, q.w]
    };
    if json {
        let objects: Vec<_> = scene
            .objects
            .values()
            .map(|object| {
                serde_json::json!({
                    "name": object.name, "body": object.body_id, "pose": numbers(object), "group": object.group,
                    "padding_m": object.padding_m, "held_by": object.attachment.as_ref().map(|held| &held.to),
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
        let short: String = object.body_id.chars().take(12).collect();
        text += &format!("{name:width$}  {short}  {}", pose.join(" "));
        if !object.group.is_empty() {
            text += &format!("  group {}", object.group);
        }
        if let Some(held) = &object.attachment {
            text += &format!("  held by {}", held.to);
        }
        text.push('\n');
    }
    for proto::SubjectPair { a, b } in &scene.allowed_pairs {
        let name = |side: &Option<proto::Subject>| match side.as_ref().and_then(|side| side.subject.clone()) {
            Some(subject::Subject::Object(name)) => name,
            Some(subject::Subject::Group(name)) => format!("group {name}"),
            None => String::new(),
        };
        text += &format!("may touch: {} and {}\n", name(a), name(b));
    }
    Ok(text)
}
