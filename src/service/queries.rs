//! QueryService: snapshot, pairs, solver, answers.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use tonic::{Request, Response, Status};

use crate::body::Body;
use crate::measure::{self, Pose, WarmStart};
use crate::scene::Scene;
use crate::store::CatalogueError;

use super::app_state::AppState;
use super::error::{self, Invalid};
use super::limits::{MAX_EVALUATIONS, PAIRS_AT_ONCE};
use super::proto::evaluate_result::Outcome;
use super::proto::query_service_server::QueryService;
use super::proto::{EvaluateRequest, EvaluateResponse, EvaluateResult, Measure};
use super::wire::{self, Accuracy};

#[derive(Debug)]
pub(super) struct Queries(pub(super) AppState);

/// A body where it stands: the snapshot's pose or the call's own.
struct Placed {
    body: Arc<Body>,
    pose: Pose,
}

#[tonic::async_trait]
impl QueryService for Queries {
    async fn evaluate(&self, request: Request<EvaluateRequest>) -> Result<Response<EvaluateResponse>, Status> {
        let request = request.into_inner();
        wire::name(&request.scene, "scene")?;
        let measures = wire::measures(&request)?;
        let count = request.pairs.len() * measures.len();
        if count == 0 {
            return Err(Invalid::new("pairs", "is empty; name at least one pair").into());
        }
        if count > MAX_EVALUATIONS {
            let why = format!("asks for {count} results with these measures; at most {MAX_EVALUATIONS} fit, split it");
            return Err(Invalid::new("pairs", why).into());
        }
        let accuracy = wire::accuracy(request.accuracy.as_ref())?;
        let overrides = wire::overrides(&request.pose_overrides)?;

        let scene = self
            .0
            .catalogue()
            .await?
            .scene(&request.scene)
            .ok_or_else(|| error::catalogue(&CatalogueError::NoScene(request.scene.clone()), "scene"))?;
        let pairs: Arc<[_]> = resolve(&request, &scene, &overrides)?.into();
        let measures: Arc<[_]> = measures.into();
        let revision = scene.revision();

        // Every share queues again behind the calls that came meanwhile, so a long call does not
        // hold up short ones; and when the client goes away this handler is dropped and no further
        // share is begun.
        let mut results = Vec::with_capacity(count);
        for from in (0..pairs.len()).step_by(PAIRS_AT_ONCE) {
            let (pairs, measures) = (pairs.clone(), measures.clone());
            let share = from..(from + PAIRS_AT_ONCE).min(pairs.len());
            results.extend(self.0.solve(move || evaluate(&pairs, share, &measures, accuracy, revision)).await?);
        }
        Ok(Response::new(EvaluateResponse { results }))
    }
}

/// Looks up both objects of every pair.
fn resolve(
    request: &EvaluateRequest,
    scene: &Scene,
    overrides: &HashMap<&str, Pose>,
) -> Result<Vec<(Placed, Placed)>, Status> {
    let find = |name: &str, field: String| {
        wire::name(name, &field)?;
        let missing = || format!("no object \"{name}\" in scene \"{}\"; add it first", scene.name());
        let object = scene.object(name).ok_or_else(|| error::not_found("object", name, &field, missing()))?;
        let pose = overrides.get(name).copied().unwrap_or(object.pose);
        Ok::<_, Status>(Placed { body: object.body.clone(), pose })
    };
    for (index, object) in request.pose_overrides.iter().enumerate() {
        find(&object.name, format!("pose_overrides[{index}].name"))?;
    }
    let mut pairs = Vec::with_capacity(request.pairs.len());
    for (index, pair) in request.pairs.iter().enumerate() {
        let a = find(&pair.a, format!("pairs[{index}].a"))?;
        let b = find(&pair.b, format!("pairs[{index}].b"))?;
        if pair.a == pair.b {
            return Err(Invalid::new(format!("pairs[{index}]"), "pairs an object with itself; name two").into());
        }
        pairs.push((a, b));
    }
    Ok(pairs)
}

/// Solves a share of the pairs cold, one by one, so that an answer depends on nothing but its own
/// pair.
fn evaluate(
    pairs: &[(Placed, Placed)],
    share: Range<usize>,
    measures: &[Measure],
    accuracy: Accuracy,
    scene_revision: u64,
) -> Vec<EvaluateResult> {
    let mut results = Vec::with_capacity(share.len() * measures.len());
    for index in share {
        let (a, b) = &pairs[index];
        for &measure in measures {
            let outcome = one(a, b, measure, accuracy);
            results.push(EvaluateResult { pair_index: wire::count(index), scene_revision, outcome });
        }
    }
    results
}

fn one(a: &Placed, b: &Placed, measure: Measure, accuracy: Accuracy) -> Option<Outcome> {
    let level = |on: &Placed, of: &Placed| {
        let warm = &mut WarmStart::default();
        let found = measure::level_distance(&*on.body, &on.pose, &*of.body, &of.pose, &accuracy.level, warm);
        wire::level_distance(&found)
    };
    match measure {
        Measure::Unspecified => None,
        Measure::Distance => {
            let warm = &mut WarmStart::default();
            let found = measure::distance(&*a.body, &a.pose, &*b.body, &b.pose, &accuracy.distance, warm);
            Some(Outcome::Distance(wire::distance(&found, (&a.body, &a.pose), (&b.body, &b.pose))))
        }
        Measure::LevelDistanceAOnB => Some(Outcome::LevelDistanceAOnB(level(a, b))),
        Measure::LevelDistanceBOnA => Some(Outcome::LevelDistanceBOnA(level(b, a))),
    }
}
