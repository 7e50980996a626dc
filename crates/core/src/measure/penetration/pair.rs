//! Penetration depth of two bodies.

use super::answer::Penetration;
use super::closed_form::of_shapes;
use crate::body::Body;
use crate::measure::frames::query_frame::Pair;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::depth::local_search::{Best, tolerance};
use crate::measure::solver::depth::sweep::prove;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;

/// Penetration depth of two bodies.
pub(super) fn between(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Penetration {
    if runs(Stage::ClosedForm)
        && let Some(found) = of_shapes((a, pose_a), (b, pose_b), options, warm)
    {
        return found;
    }
    let pair = Pair::new(a, pose_a, b, pose_b);
    let mut best = Best::new(&pair, pose_a, pose_b, options);
    best.follow(&warm.hint);
    let proof = prove(&mut best);
    if let Some(hint) = best.hint() {
        warm.hint = hint;
    }
    let apart = best.depth <= 0.0;
    let upper = best.depth.max(0.0);
    let unit = pair.unit();
    Penetration {
        status: Status::of(upper - proof.lower <= tolerance(&pair, options, upper)),
        lower: proof.lower * unit,
        upper: upper * unit,
        direction: best.n.filter(|_| !apart).map(|n| pair.direction_to_world(&n)),
        witness_a: pair.to_world(&best.x),
        witness_b: pair.to_world(&best.y),
        tied: proof.tied,
        directions: proof.directions,
        iterations: best.iterations,
    }
}
