//! The distance of two bodies of which at least one has several constraints.

use super::answer::Distance;
use super::query::Query;
use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::solver::continuation::Lost;
use crate::measure::solver::edge_newton::{EdgeProven, EdgeQuery, EdgeStart, EdgeTrace};
use crate::measure::solver::initial_guess::Start;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::{Matrix3, Vector3};

/// The distance by Newton's method with active sets, from the last answer or from where the
/// outlines are nearest; the hint is replaced where it is proven.
///
/// # Errors
/// What the general search has to go on from.
// What is lost is about as large as what is proven, and there is no allocation in a solve.
#[allow(clippy::result_large_err)]
pub(super) fn of_edges(query: &Query<'_>, warm: &mut WarmStart) -> Result<Distance, Lost> {
    let Query { of_a: (a, pose_a), of_b: (b, pose_b), goal, options, .. } = *query;
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    let witnesses = witnesses((a, pose_a), pose_b, &warm.hint);
    let mut place;
    let (start, trace) = match &mut warm.hint {
        Hint::Edges(trace) => (Some(EdgeStart::Last), trace),
        _ => {
            place = EdgeTrace::default();
            (witnesses.map(EdgeStart::Witnesses), &mut place)
        }
    };
    let found = dispatch(EdgeQuery { a, pose_a, b, pose_b, goal, tolerance, options, start, trace })?;
    if !matches!(start, Some(EdgeStart::Last)) {
        warm.hint = Hint::Edges(*trace);
    }
    let narrow = found.upper - found.lower <= tolerance;
    if narrow || goal.met(found.lower, found.upper) {
        Ok(answer((a, pose_a), &found, narrow))
    } else {
        Ok(query.refined(found.rounds, |search| search.resume_edges(&found)))
    }
}

/// What the general search has found.
#[inline(always)]
fn witnesses((a, pose_a): (&Body, &Pose), pose_b: &Pose, hint: &Hint) -> Option<Start<f64>> {
    let Hint::Apart { x_a, y_b, normal_a, .. } = hint else { return None };
    let center = a.normalization().center;
    let y = pose_a.rotation().inverse_transform_vector(&(pose_b.transform_point(y_b) - pose_a.translation()));
    Some(Start { x: (x_a - center).into(), y: (y - center).into(), n: (*normal_a).into() })
}

/// What is proven as an answer, converged if `narrow`.
fn answer((a, pose_a): (&Body, &Pose), found: &EdgeProven, narrow: bool) -> Distance {
    let rotation: Matrix3<f64> = *pose_a.rotation().to_rotation_matrix().matrix();
    let center = a.normalization().center;
    let to_world = |v: [f64; 3]| rotation * (Vector3::from(v) + center) + pose_a.translation();
    Distance {
        status: Status::of(narrow),
        lower: found.lower,
        upper: found.upper,
        witness_a: to_world(found.x),
        witness_b: to_world(found.y),
        normal: Some(rotation * Vector3::from(found.n)),
        active_a: found.active_a,
        active_b: found.active_b,
        parts: [0, 0],
        tied: false,
        iterations: found.rounds,
    }
}
