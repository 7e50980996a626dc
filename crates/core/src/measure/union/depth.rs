//! How deep unions overlap, and their signed distance.
//!
//! A translation that separates the unions separates every pair of parts: the depth is at least the
//! largest of the pairs' depths. It is at most the length of any translation that is proven to
//! separate them all ([`separating_translation`]).

use super::pairwise_minimum::{Least, least};
use super::separating_translation::{self, Contact, Start, Starts, Way};
use super::status;
use crate::body::Solid;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::overlap::ball_gap;
use crate::measure::penetration::{self, Penetration};
use crate::measure::signed::{self, SignedDistance};
use crate::measure::warm::WarmStart;

/// Penetration depth of two solids.
#[inline]
pub(in crate::measure) fn penetration(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Penetration {
    let (parts_a, parts_b) = (a.parts(), b.parts());
    if let ([a], [b]) = (parts_a, parts_b) {
        return penetration::between(a, pose_a, b, pose_b, options, warm);
    }
    let (mut starts, mut directions) = (Starts::default(), 0);
    let gap = |(i, j): (usize, usize)| ball_gap((&parts_a[i], pose_a), (&parts_b[j], pose_b));
    let Least { best, iterations, .. } =
        least((parts_a.len(), parts_b.len()), gap, f64::NEG_INFINITY, warm, |pair, _, hint| {
            let found = penetration::between(&parts_a[pair.0], pose_a, &parts_b[pair.1], pose_b, options, hint);
            directions += found.directions;
            if let Some(direction) = found.direction {
                starts.push(Start { pair, direction, depth: found.upper });
            }
            found
        });
    if starts.is_empty() {
        return Penetration { directions, iterations, ..best };
    }
    let way = separating_translation::out(
        (a, pose_a),
        (b, pose_b),
        &starts,
        best.lower,
        |depth| narrow(a, b, depth, options),
        options,
    );
    let (lower, upper) = (best.lower, way.length);
    let narrow = upper - lower <= narrow(a, b, upper, options);
    Penetration {
        status: status(narrow),
        lower,
        upper,
        direction: Some(way.direction),
        witness_a: way.contacts[0].x,
        witness_b: way.contacts[0].y,
        // Another way out for the deepest pair counts if that pair is what decides.
        tied: way.tied || best.tied && narrow,
        directions,
        iterations: iterations + way.iterations,
    }
}

/// Width of the bracket of a depth that is asked for, metres.
fn narrow(a: &impl Solid, b: &impl Solid, depth: f64, options: &Options<'_>) -> f64 {
    let radius = a.circumscribed().radius.min(b.circumscribed().radius);
    (options.depth_accuracy() * depth).max(options.accuracy() * radius)
}

/// Signed distance of two solids.
#[inline]
pub(in crate::measure) fn signed_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> SignedDistance {
    let (parts_a, parts_b) = (a.parts(), b.parts());
    if let ([a], [b]) = (parts_a, parts_b) {
        return signed::between(a, pose_a, b, pose_b, options, warm);
    }
    let mut starts = Starts::default();
    let gap = |(i, j): (usize, usize)| ball_gap((&parts_a[i], pose_a), (&parts_b[j], pose_b));
    let found = least((parts_a.len(), parts_b.len()), gap, f64::NEG_INFINITY, warm, |pair, _, hint| {
        let found = signed::between(&parts_a[pair.0], pose_a, &parts_b[pair.1], pose_b, options, hint);
        if let Some(direction) = found.normal.filter(|_| found.lower <= 0.0) {
            starts.push(Start { pair, direction, depth: -found.lower });
        }
        found
    });
    let Least { best, lower, tied, iterations } = found;
    if lower > 0.0 || starts.is_empty() {
        let status = status(best.upper - lower <= narrow(a, b, 0.0, options));
        return SignedDistance { status, lower, tied: tied || best.tied, iterations, ..best };
    }
    let least = (-best.upper).max(0.0);
    let way = separating_translation::out(
        (a, pose_a),
        (b, pose_b),
        &starts,
        least,
        |depth| narrow(a, b, depth, options),
        options,
    );
    let (lower, upper) = (-way.length, best.upper);
    let narrow = upper - lower <= narrow(a, b, if upper < 0.0 { way.length } else { 0.0 }, options);
    SignedDistance {
        status: status(narrow),
        lower,
        upper,
        witness_a: way.contacts[0].x,
        witness_b: way.contacts[0].y,
        normal: Some(way.direction),
        gradients: Some(gradients(&way, pose_a, pose_b)),
        at_contact: lower <= 0.0 && upper >= 0.0,
        tied: way.tied || best.tied && narrow,
        iterations: iterations + way.iterations,
    }
}

/// Derivatives of minus the length of a way with respect to both poses: each pair of parts that
/// holds the solids back adds its pull, at the points where it does (envelope theorem).
fn gradients(way: &Way, pose_a: &Pose, pose_b: &Pose) -> [Twist; 2] {
    way.contacts.iter().fold([Twist::ZERO; 2], |[a, b], Contact { pull, x, y }| {
        let of_a = Twist::of_force(*pull, x, pose_a.translation());
        let of_b = Twist::of_force(-pull, y, pose_b.translation());
        [a + of_a, b + of_b]
    })
}
