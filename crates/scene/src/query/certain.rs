//! Decisions about pairs that may be displaced by rounding.

use nalgebra::Vector3;
use sublevel_core::body::{Body, Solid};
use sublevel_core::measure::{Options, Pose, WarmStart, distance, signed_distance};

use super::answer::Verdict;
use super::decide::{Bracket, decide};
use super::solver::{Pair, Solver};
use super::thing::{Thing, ball_gap};
use crate::broad_phase::world_ball;

/// Compares the signed distance of a pair with a threshold in metres where the two may be displaced
/// against each other by `slack_m`, as links by the rounding of kinematics: NO and YES hold however
/// they are.
pub(crate) fn decide_within<'o>(
    solver: &Solver<'_>,
    pair: &Pair<'_>,
    (threshold, slack_m): (f64, f64),
    options: impl Fn() -> Options<'o>,
) -> Bracket {
    if slack_m == 0.0 {
        return decide(solver, pair, threshold, options());
    }
    let outer = decide(solver, pair, threshold + slack_m, options());
    let (mut lower, mut upper, mut verdict) = (outer.lower, outer.upper, outer.verdict);
    if verdict != Verdict::No {
        let inner = threshold - slack_m;
        verdict = Verdict::Undecided;
        if let (Some(parts), true) = (solid_parts(pair), threshold == 0.0) {
            if let Some(depth) = overlapping_parts(&parts, inner, &options()) {
                (verdict, upper) = (Verdict::Yes, upper.min(depth));
            }
        } else {
            let found = decide(solver, pair, inner, options());
            (lower, upper) = (lower.max(found.lower), upper.min(found.upper));
            if found.verdict == Verdict::Yes {
                verdict = Verdict::Yes;
            }
        }
    }
    Bracket { verdict, lower: lower - slack_m, upper: upper + slack_m, ..outer }
}

/// Parts of both sides where they stand.
type Parts<'a> = [(&'a [Body], &'a Pose); 2];

/// The parts of two solids, of their finest rungs.
fn solid_parts<'a>(pair: &Pair<'a>) -> Option<Parts<'a>> {
    let parts = |thing: &Thing<'a>| match *thing {
        Thing::Solid { rungs, pose, set: None } => Some((rungs.last()?.parts(), pose)),
        _ => None,
    };
    Some([parts(&pair.a)?, parts(&pair.b)?])
}

/// Upper bound below a threshold of the signed distance of two parts, metres: how deep all of them
/// overlap takes much longer, and says no more.
fn overlapping_parts([a, b]: &Parts<'_>, threshold: f64, options: &Options<'_>) -> Option<f64> {
    let ball = |body: &Body, pose: &Pose| world_ball(pose, (body.circumscribed().center, body.circumscribed().radius));
    let mut near = Vec::new();
    for one in a.0 {
        for other in b.0 {
            let gap = ball_gap(ball(one, a.1), ball(other, b.1));
            if gap < threshold {
                near.push((gap, one, other));
            }
        }
    }
    near.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
    near.into_iter().find_map(|(_, one, other)| {
        let mut warm = WarmStart::default();
        let found = distance(one, a.1, other, b.1, options, &mut warm);
        if found.upper > 0.0 {
            return None;
        }
        deep_point([(one, a.1), (other, b.1)], &found.witness_a, threshold).or_else(|| {
            let found = signed_distance(one, a.1, other, b.1, options, &mut warm);
            (found.upper < threshold).then_some(found.upper)
        })
    })
}

/// Upper bound of the signed distance of two bodies with a common point, metres, if it is below a
/// threshold: where a ball about the point lies in one of them, that one has to move by more than
/// its radius before the two are apart.
fn deep_point(bodies: [(&Body, &Pose); 2], common: &Vector3<f64>, threshold: f64) -> Option<f64> {
    bodies.into_iter().find_map(|(body, pose)| {
        let own = pose.rotation().inverse_transform_vector(&(common - pose.translation()));
        let rounding = 64.0 * f64::EPSILON * (common.norm() + own.norm() + pose.translation().norm());
        let depth = -2.0 * threshold;
        (body.value_upper_within(&own, depth + rounding) <= 1.0).then_some(-depth)
    })
}
