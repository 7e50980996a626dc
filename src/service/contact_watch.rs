//! Watch: which pairs are nearer than a margin, then which pairs cross it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use tonic::Status;

use super::app_state::{AppState, stopped};
use super::call_time::CallTime;
use super::limits::MAX_MESSAGE_BYTES;
use super::proto::{Crossing, WatchRequest, WatchResponse};
use super::reason::Reason;
use super::{error, query_wire};
use crate::scene::query::{Ask, Measure, Within, combined};
use crate::scene::{MAX_NAME_BYTES, OwnStarts, Scene};
use crate::store::LiveScene;

/// Crossings in one message: two names and two numbers each.
const PIECE_CROSSINGS: usize = MAX_MESSAGE_BYTES / 4 / (2 * MAX_NAME_BYTES + 32);

type Messages = mpsc::Sender<Result<WatchResponse, Status>>;

/// Names of a pair, in their order.
type Names = (Arc<str>, Arc<str>);

/// Near pairs with the brackets of their signed distances, metres.
type Near = BTreeMap<Names, (f64, f64)>;

/// Sends crossings until the client or the scene is gone, or the server stops. A message is made
/// when there is space for it, so who reads slowly gets the latest.
pub(super) async fn run(
    app: AppState,
    live: Arc<LiveScene>,
    (request, pause): (WatchRequest, Duration),
    messages: Messages,
) {
    let (mut changes, mut stopping) = (live.changes(), app.stopping());
    let mut scene = changes.borrow_and_update().clone();
    let resumed = request.from_revision == Some(scene.revision()) && live.knows(scene.revision());
    // The watcher must not keep a scene alive that was deleted.
    drop(live);
    let (mut known, mut starts): (Option<Near>, _) = (None, OwnStarts::default());
    loop {
        let now = match near(&app, &starts.lend(&scene), &request).await {
            Ok(now) => now,
            Err(status) => return drop(messages.send(Err(status)).await),
        };
        let first = known.is_none();
        let before = match known.take() {
            Some(known) => known,
            None if resumed => now.clone(),
            None => Near::new(),
        };
        let crossed = crossings(&before, &now);
        known = Some(now);
        if (first || !crossed.is_empty())
            && send(crossed, scene.revision(), first && !resumed, &messages).await.is_none()
        {
            return;
        }
        tokio::time::sleep(pause).await;
        tokio::select! {
            changed = changes.changed() => if changed.is_err() {
                let why = "the scene was deleted; list the scenes";
                return drop(messages.send(Err(error::not_found(Reason::SceneNotFound, scene.name(), "scene", why))).await);
            },
            () = stopped(&mut stopping) => {
                let why = "the server stops; watch again when it is back";
                return drop(messages.send(Err(error::unavailable(Reason::Stopping, why))).await);
            }
            () = messages.closed() => return,
        }
        scene = changes.borrow_and_update().clone();
    }
}

/// What crossed, in pieces; none when the client is gone.
async fn send(mut crossed: Vec<Crossing>, scene_revision: u64, reset: bool, messages: &Messages) -> Option<()> {
    let mut reset = reset;
    loop {
        let rest = crossed.split_off(crossed.len().min(PIECE_CROSSINGS));
        let complete = rest.is_empty();
        let message = WatchResponse { scene_revision, reset, crossings: crossed, complete };
        messages.send(Ok(message)).await.ok()?;
        if complete {
            return Some(());
        }
        (crossed, reset) = (rest, false);
    }
}

async fn near(app: &AppState, scene: &Scene, request: &WatchRequest) -> Result<Near, Status> {
    let selection = query_wire::selection(request.selection.as_ref(), scene, "selection")?;
    let mut ask = Ask::new(vec![Measure::Signed]).map_err(|error| error::internal(&error))?;
    ask.include_allowed = request.include_allowed;
    let (of, margin) = (scene.clone(), request.margin_m);
    let question = app.prepare(scene, move || Within::new(of, ask, selection, margin)).await?;
    let (found, _) = combined(scene, app.ask(Arc::new(question), CallTime::default()).await?);
    let name = |slot| scene.object(slot).map(|object| object.name.clone());
    let near = found.into_iter().filter_map(|found| {
        let [a, b] = found.pair;
        let answer = found.answers.first()?;
        Some(((name(a)?, name(b)?), (answer.lower, answer.upper)))
    });
    Ok(near.collect())
}

/// What is near now and was not, and the other way round, in the order of names.
fn crossings(before: &Near, now: &Near) -> Vec<Crossing> {
    let entered =
        now.iter().filter(|(pair, _)| !before.contains_key(*pair)).map(|(pair, bracket)| (pair, Some(*bracket)));
    let left = before.keys().filter(|pair| !now.contains_key(*pair)).map(|pair| (pair, None));
    let mut crossed: Vec<_> = entered.chain(left).collect();
    crossed.sort_by_key(|(pair, _)| *pair);
    let crossing = |((a, b), bracket): (&Names, Option<(f64, f64)>)| {
        let (lower_m, upper_m) = bracket.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        Crossing { a: a.to_string(), b: b.to_string(), near: bracket.is_some(), lower_m, upper_m }
    };
    crossed.into_iter().map(crossing).collect()
}
