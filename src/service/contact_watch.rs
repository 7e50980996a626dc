//! Watch: which pairs are nearer than a margin, then which pairs cross it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use tonic::Status;

use super::app_state::{AppState, stopped};
use super::call_time::CallTime;
use super::proto::{Crossing, WatchRequest, WatchResponse};
use super::{error, query_wire};
use crate::scene::Scene;
use crate::scene::query::{Ask, Measure, Within, combined};
use crate::store::LiveScene;

type Messages = mpsc::Sender<Result<WatchResponse, Status>>;

/// Names of a pair, in their order.
type Names = (Arc<str>, Arc<str>);

/// Near pairs with the brackets of their signed distances, metres.
type Near = BTreeMap<Names, (f64, f64)>;

/// Sends crossings until the client or the scene is gone, or the server stops. A message is made when
/// there is space for it, so who reads slowly gets the latest.
pub(super) async fn run(
    app: AppState,
    live: Arc<LiveScene>,
    (request, pause): (WatchRequest, Duration),
    messages: Messages,
) {
    let (mut changes, mut stopping) = (live.changes(), app.stopping());
    // The watcher must not keep a scene alive that was deleted.
    drop(live);
    let mut scene = changes.borrow_and_update().clone();
    let mut known = None;
    if request.from_revision == Some(scene.revision()) {
        match near(&app, &scene, &request).await {
            Ok(near) => known = Some(near),
            Err(status) => return drop(messages.send(Err(status)).await),
        }
    }
    let mut first = true;
    loop {
        let now = match near(&app, &scene, &request).await {
            Ok(now) => now,
            Err(status) => return drop(messages.send(Err(status)).await),
        };
        let reset = known.is_none();
        let crossings = crossings(&known.take().unwrap_or_default(), &now);
        known = Some(now);
        if first || reset || !crossings.is_empty() {
            let message = WatchResponse { scene_revision: scene.revision(), reset, crossings };
            if messages.send(Ok(message)).await.is_err() {
                return;
            }
        }
        first = false;
        tokio::time::sleep(pause).await;
        tokio::select! {
            changed = changes.changed() => if changed.is_err() {
                let why = "the scene was deleted; list the scenes";
                return drop(messages.send(Err(error::not_found("scene", scene.name(), "scene", why))).await);
            },
            () = stopped(&mut stopping) => {
                let why = "the server stops; watch again when it is back";
                return drop(messages.send(Err(error::unavailable("STOPPING", why))).await);
            }
            () = messages.closed() => return,
        }
        scene = changes.borrow_and_update().clone();
    }
}

async fn near(app: &AppState, scene: &Scene, request: &WatchRequest) -> Result<Near, Status> {
    let selection = query_wire::selection(request.selection.as_ref(), scene, "selection")?;
    let mut ask = Ask::new(vec![Measure::Signed]).map_err(|error| error::internal(&error))?;
    ask.include_allowed = request.include_allowed;
    let (of, margin) = (scene.clone(), request.margin_m);
    let question = app.prepare(move || Within::new(of, ask, selection, margin)).await?;
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
