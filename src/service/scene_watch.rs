//! WatchScene: the content of a scene, then what changes, conflated.

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::{mpsc, watch};
use tonic::Status;

use super::app_state::stopped;
use super::error;
use super::limits::MAX_MESSAGE_BYTES;
use super::packed::Packed;
use super::proto::{WatchSceneResponse, WatchedObject};
use super::reason::Reason;
use super::robot_wire;
use super::scene_wire::object_message;
use crate::scene::{Scene, Slot};
use crate::store::LiveScene;

/// Bytes of objects or poses in one message.
const PIECE_BYTES: usize = MAX_MESSAGE_BYTES / 4;

/// Poses in one message.
const PIECE_POSES: usize = PIECE_BYTES / 60;

type Messages = mpsc::Sender<Result<WatchSceneResponse, Status>>;

/// Sends changes until the client or the scene is gone, or the server stops. A message is made when
/// there is space for it, so who reads slowly gets the latest.
pub(super) async fn run(
    (live, mut stopping): (Arc<LiveScene>, watch::Receiver<bool>),
    from_revision: Option<u64>,
    pause: Duration,
    messages: Messages,
) {
    let mut changes = live.changes();
    let from_revision = from_revision.filter(|from| live.knows(*from));
    // The watcher must not keep a scene alive that was deleted.
    drop(live);
    let scene = changes.borrow_and_update().clone();
    let sent = match from_revision {
        Some(from) if from >= scene.structure_revision() => send_moved(&scene, from, &messages).await,
        _ => send_whole(&scene, &messages).await,
    };
    let mut before = scene;
    if sent.is_none() {
        return;
    }
    loop {
        tokio::select! {
            changed = changes.changed() => if changed.is_err() {
                let why = "the scene was deleted; list the scenes";
                let _ = messages.send(Err(error::not_found(Reason::SceneNotFound, before.name(), "scene", why))).await;
                return;
            },
            () = stopped(&mut stopping) => {
                let why = "the server stops; watch again when it is back";
                let _ = messages.send(Err(error::unavailable(Reason::Stopping, why))).await;
                return;
            }
            () = messages.closed() => return,
        }
        // Room first, then the latest snapshot.
        let Ok(space) = messages.reserve().await else { return };
        drop(space);
        let scene = changes.borrow_and_update().clone();
        let sent = if scene.structure_revision() == before.structure_revision() {
            send_moved(&scene, before.revision(), &messages).await
        } else {
            send_whole(&scene, &messages).await
        };
        if sent.is_none() {
            return;
        }
        before = scene;
        tokio::time::sleep(pause).await;
    }
}

/// All objects, in pieces; none when the client is gone.
async fn send_whole(scene: &Scene, messages: &Messages) -> Option<()> {
    let begin = || WatchSceneResponse { revision: scene.revision(), ..Default::default() };
    let mut piece = WatchSceneResponse { reset: true, ..begin() };
    let mut bytes = 0;
    for (slot, object, pose) in scene.objects() {
        let watched = WatchedObject { index: slot, object: Some(object_message(object, pose)) };
        bytes += prost::Message::encoded_len(&watched);
        piece.objects.push(watched);
        if bytes > PIECE_BYTES {
            messages.send(Ok(std::mem::replace(&mut piece, begin()))).await.ok()?;
            bytes = 0;
        }
    }
    for robot in scene.robots() {
        let robot = robot_wire::instance(&robot);
        bytes += prost::Message::encoded_len(&robot);
        piece.robots.push(robot);
        if bytes > PIECE_BYTES {
            messages.send(Ok(std::mem::replace(&mut piece, begin()))).await.ok()?;
            bytes = 0;
        }
    }
    piece.complete = true;
    messages.send(Ok(piece)).await.ok()
}

/// Poses that were set after a revision, in pieces, with the robots that moved in the last one;
/// none when the client is gone.
async fn send_moved(scene: &Scene, from: u64, messages: &Messages) -> Option<()> {
    let moved: Vec<Slot> = scene.moved_since(from).collect();
    let mut pieces = moved.chunks(PIECE_POSES).peekable();
    let robots = scene.robots().filter(|robot| robot.moved_at() > from);
    let mut robots: Vec<_> = robots.map(|robot| robot_wire::instance(&robot)).collect();
    if pieces.peek().is_none() {
        let message = WatchSceneResponse { revision: scene.revision(), robots, complete: true, ..Default::default() };
        return messages.send(Ok(message)).await.ok();
    }
    while let Some(piece) = pieces.next() {
        let (mut indices, mut poses) = (Packed::default(), Packed::default());
        for &slot in piece {
            if let Some(pose) = scene.pose(slot) {
                indices.index(slot);
                poses.pose(pose);
            }
        }
        let message = WatchSceneResponse {
            revision: scene.revision(),
            moved: indices.into_bytes(),
            poses: poses.into_bytes(),
            complete: pieces.peek().is_none(),
            robots: if pieces.peek().is_none() { std::mem::take(&mut robots) } else { Vec::new() },
            ..Default::default()
        };
        messages.send(Ok(message)).await.ok()?;
    }
    Some(())
}
