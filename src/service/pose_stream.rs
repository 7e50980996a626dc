//! StreamPoses: messages are read while poses are applied; what comes meanwhile is merged, the
//! latest pose of each object wins.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Instant;

use tokio::sync::mpsc;
use tonic::{Status, Streaming};

use super::app_state::{AppState, stopped};
use super::error::{self, Invalid};
use super::proto::{StreamPosesRequest, StreamPosesResponse};
use super::reason::Reason;
use super::{packed, wire};
use crate::measure::Pose;
use crate::robot::counted;
use crate::scene::{MAX_OBJECTS, Scene, SceneError, Slot};
use crate::store::{CatalogueError, LiveScene};

type Replies = mpsc::Sender<Result<StreamPosesResponse, Status>>;

/// Poses that are applied by the thread that reads them: tens of microseconds.
const FEW_POSES: usize = 512;

/// What messages refer to.
#[derive(Debug)]
struct Table {
    scene: String,
    live: Arc<LiveScene>,
    names: Vec<Arc<str>>,
}

/// Poses that wait to be applied: at most one for each object of the scene.
#[derive(Debug, Default)]
struct Pending {
    poses: HashMap<Arc<str>, Pose>,
    sequence: u64,
    messages: u32,
    merged: u32,
    /// When the first of them came.
    since: Option<Instant>,
}

/// Applies the messages of a client until it has sent all, or is gone.
pub(super) async fn run(app: AppState, mut messages: Streaming<StreamPosesRequest>, replies: Replies) {
    let (mut table, mut stopping): (Option<Table>, _) = (None, app.stopping());
    let (mut pending, mut ended) = (Pending::default(), false);
    let mut applying: Option<tokio::task::JoinHandle<Result<StreamPosesResponse, Status>>> = None;
    let mut reply: Option<StreamPosesResponse> = None;
    let mut stopped_before_end = false;
    loop {
        if ended && pending.messages == 0 && applying.is_none() && reply.is_none() {
            if stopped_before_end {
                let why = "the server stops; stream again when it is back";
                let _ = replies.send(Err(error::unavailable(Reason::Stopping, why))).await;
            }
            return;
        }
        tokio::select! {
            message = messages.message(), if !ended => match message {
                Ok(Some(message)) => {
                    let sequence = message.sequence;
                    if let Err(status) = read(&app, message, &mut table, &mut pending).await {
                        if table.is_none() {
                            // Nothing can follow: which scene is meant is not known.
                            let _ = replies.send(Err(status)).await;
                            return;
                        }
                        let refused = StreamPosesResponse {
                            sequence,
                            error: Some(error::in_stream(&status)),
                            ..Default::default()
                        };
                        // A client that sends nonsense and reads nothing is not read on.
                        if replies.send(Ok(refused)).await.is_err() {
                            return;
                        }
                    }
                }
                Ok(None) => ended = true,
                Err(status) => {
                    let _ = replies.send(Err(status)).await;
                    return;
                }
            },
            // What came before is applied and acknowledged; nothing more is read.
            () = stopped(&mut stopping), if !ended => {
                ended = true;
                stopped_before_end = true;
            }
            // In no order: what has come already may be merged first, and all others have their
            // turn.
            () = std::future::ready(()), if applying.is_none() && pending.messages > 0 => {
                let (Some(table), poses) = (&table, std::mem::take(&mut pending)) else { continue };
                match apply_at_once(&app, table, &poses).await {
                    Some(Ok(done)) => reply = Some(merged(reply.take(), done)),
                    Some(Err(status)) => { let _ = replies.send(Err(status)).await; return; }
                    None => applying = Some(tokio::spawn(apply(app.clone(), table.live.clone(), poses))),
                }
            }
            applied = async { match &mut applying { Some(task) => task.await, None => std::future::pending().await } } => {
                applying = None;
                match applied {
                    Ok(Ok(done)) => reply = Some(merged(reply.take(), done)),
                    Ok(Err(status)) => { let _ = replies.send(Err(status)).await; return; }
                    Err(error) => { let _ = replies.send(Err(error::internal_panic(&error))).await; return; }
                }
            },
            // Nobody waits for answers: the client is gone, or its token is.
            () = replies.closed() => return,
            space = replies.reserve(), if reply.is_some() => match space {
                Ok(space) => if let Some(reply) = reply.take() { space.send(Ok(reply)); },
                Err(_) => return,
            },
        }
    }
}

/// One acknowledgement in place of two that were not read.
fn merged(before: Option<StreamPosesResponse>, now: StreamPosesResponse) -> StreamPosesResponse {
    let Some(before) = before else { return now };
    StreamPosesResponse {
        message_count: before.message_count.saturating_add(now.message_count),
        merged_count: before.merged_count.saturating_add(now.merged_count),
        ..now
    }
}

/// Reads a message whole, or refuses it whole.
async fn read(
    app: &AppState,
    message: StreamPosesRequest,
    table: &mut Option<Table>,
    pending: &mut Pending,
) -> Result<(), Status> {
    let StreamPosesRequest { scene, names, indices, poses, sequence } = message;
    match table {
        None => {
            let live = app.live_scene(&scene, "scene").await?;
            *table = Some(Table { scene, live, names: Vec::new() });
        }
        Some(table) if !scene.is_empty() && scene != table.scene => {
            let why = format!("is another scene than \"{}\" before; open a stream for each", table.scene);
            return Err(Invalid::new("scene", why).into());
        }
        Some(_) => {}
    }
    let Some(table) = table else { return Ok(()) };
    let current = table.live.snapshot();
    if !names.is_empty() {
        table.names = checked(&names, &current, &table.scene)?;
    }
    let poses = packed::poses(&poses, "poses")?;
    let indices: Vec<u32> = packed::indices::<1>(&indices, "indices")?.into_iter().flatten().collect();
    let count = if indices.is_empty() { table.names.len() } else { indices.len() };
    if poses.len() != count && !(poses.is_empty() && indices.is_empty()) {
        let (poses, objects) = (counted(poses.len(), "pose", "poses"), counted(count, "object", "objects"));
        let why = format!("holds {poses} for {objects}; send one for each");
        return Err(Invalid::new("poses", why).into());
    }
    let mut moved = Vec::with_capacity(poses.len());
    for (place, pose) in poses.into_iter().enumerate() {
        let index = indices.get(place).map_or(Some(place), |index| usize::try_from(*index).ok());
        let name = index.and_then(|index| table.names.get(index)).ok_or_else(|| {
            let names = counted(table.names.len(), "name", "names");
            let why = format!("is no position in the table of {names}; count from 0");
            Status::from(Invalid::new(format!("indices[{place}]"), why))
        })?;
        if current.slot(name).is_none() {
            return Err(no_object(name, "names", &table.scene));
        }
        moved.push((name.clone(), pose));
    }
    for (name, pose) in moved {
        pending.merged += u32::from(pending.poses.insert(name, pose).is_some());
    }
    (pending.sequence, pending.messages) = (sequence, pending.messages.saturating_add(1));
    pending.since.get_or_insert_with(Instant::now);
    Ok(())
}

fn checked(names: &[String], scene: &Scene, of: &str) -> Result<Vec<Arc<str>>, Status> {
    if names.len() > MAX_OBJECTS {
        let why = format!("names {} objects; a scene has at most {MAX_OBJECTS} (max_objects)", names.len());
        return Err(Invalid::new("names", why).into());
    }
    let mut seen = std::collections::HashSet::new();
    let mut table = Vec::with_capacity(names.len());
    for (index, name) in names.iter().enumerate() {
        let at = || format!("names[{index}]");
        wire::name(name, &at())?;
        if !seen.insert(name) {
            return Err(Invalid::new(at(), format!("object \"{name}\" is named twice; name it once")).into());
        }
        let slot = scene.slot(name).ok_or_else(|| no_object(name, &at(), of))?;
        if let Some(link) = scene.object(slot).and_then(|object| object.link.as_ref()) {
            let why = format!("object \"{name}\" is a link of robot \"{}\"; set the joints of the robot", link.robot);
            return Err(Invalid::new(at(), why).into());
        }
        table.push(name.as_str().into());
    }
    Ok(table)
}

fn no_object(name: &str, field: &str, scene: &str) -> Status {
    let why = format!("no object \"{name}\" in scene \"{scene}\"; add it first");
    error::not_found(Reason::ObjectNotFound, name, field, why)
}

/// Applies poses here, if they are few, nothing has to be written, and nobody else changes the
/// scene.
async fn apply_at_once(
    app: &AppState,
    table: &Table,
    pending: &Pending,
) -> Option<Result<StreamPosesResponse, Status>> {
    let catalogue = match app.catalogue().await {
        Ok(catalogue) => catalogue,
        Err(status) => return Some(Err(status)),
    };
    let is_there = catalogue.live_scene(&table.scene).is_ok_and(|now| Arc::ptr_eq(&now, &table.live));
    if !is_there {
        return Some(Err(error::catalogue(&CatalogueError::NoScene(table.scene.clone()), "scene")));
    }
    if pending.poses.len() > FEW_POSES {
        return None;
    }
    let next = catalogue.stream_poses_at_once(&table.live, |scene| Ok(pending.placed(scene)))?;
    Some(acknowledged(app, pending, next))
}

async fn apply(app: AppState, live: Arc<LiveScene>, pending: Pending) -> Result<StreamPosesResponse, Status> {
    let catalogue = app.catalogue().await?;
    let moved = tokio::task::spawn_blocking(move || {
        let next = catalogue.stream_poses::<CatalogueError>(&live, |scene| Ok(pending.placed(scene)));
        (pending, next)
    });
    let (pending, next) = moved.await.map_err(|error| error::internal_panic(&error))?;
    acknowledged(&app, &pending, next)
}

impl Pending {
    /// Slots with their poses. An object that was removed meanwhile, or is a link now, needs none.
    fn placed(&self, scene: &Scene) -> Vec<(Slot, Pose)> {
        let slot = |name: &str| {
            let slot = scene.slot(name)?;
            scene.object(slot).is_some_and(|object| object.link.is_none()).then_some(slot)
        };
        self.poses.iter().filter_map(|(name, pose)| Some((slot(name)?, *pose))).collect()
    }
}

fn acknowledged(
    app: &AppState,
    &Pending { ref poses, sequence, messages, merged, since }: &Pending,
    next: Result<Scene, CatalogueError>,
) -> Result<StreamPosesResponse, Status> {
    let next = match next {
        Ok(next) => next,
        Err(CatalogueError::Scene(SceneError::Pose { name, error })) => {
            let why = format!("object \"{name}\" would be held at no usable pose: {error}");
            let status = Status::from(Invalid::new("poses", why));
            let error = Some(error::in_stream(&status));
            return Ok(StreamPosesResponse { sequence, error, ..Default::default() });
        }
        Err(error) => return Err(error::catalogue(&error, "scene")),
    };
    let count = poses.len() as u64 + u64::from(merged);
    app.metrics().streamed(count, merged.into(), since.map(|since| since.elapsed()).unwrap_or_default());
    Ok(StreamPosesResponse {
        revision: next.revision(),
        sequence,
        message_count: messages,
        merged_count: merged,
        error: None,
    })
}
