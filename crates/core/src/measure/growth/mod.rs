//! Growth distance: how much two bodies must grow about their centres to touch (Ong and Gilbert,
//! Growth distances: new measures for object separation and penetration, IEEE Trans. Robotics and
//! Automation 12, 1996).
//!
//! With `Δ = c_B - c_A` between the centres, `c_A + s (A - c_A)` and `c_B + s (B - c_B)` meet if
//! and only if `Δ / s` lies in `K = (A - c_A) - (B - c_B)`. So s is the gauge of K at Δ: along the
//! unit vector `u = Δ/|Δ|` the program asks for the longest
//!
//! ```text
//! ρ u = (x - c_A) - (y - c_B),   x in A, y in B,   and s = |Δ| / ρ.
//! ```
//!
//! K does not depend on where the bodies are, only on how they are turned: the program is posed
//! with the centres put on top of each other, so neither far nor deep pairs lose digits. With the
//! support functions H about the centres and an inscribed ball of K of radius R, for every vector
//! n, every w in K and every t >= 0
//!
//! ```text
//! n·Δ / (H_A(n) + H_B(-n)) <= s <= t + |Δ - t w| / R,
//! ```
//!
//! the left by duality, the right because a gauge is subadditive.

mod answer;
mod closed_form;
mod minkowski_portal;
mod pair;
mod problem;
#[cfg(test)]
mod tests;

use crate::body::{Body, PartCenters, PartNode, Solid};
use crate::measure::bounds::culling::CULLING_SLACK;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::other_parts::Recalled;
use crate::measure::pairwise_minimum::nearest;
use crate::measure::part_pairs::{NodeBound, SeenFrame, TreePair, centers, nodes, only_centers, only_node};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
pub use answer::GrowthDistance;
use pair::between;

/// Growth distance of two bodies at their poses (body to world): the smallest s at which `c_A + s
/// (A - c_A)` and `c_B + s (B - c_B)` touch, about the centres of [`Body::growth_ball`]. Above 1
/// the bodies are apart, at 1 they touch, below 1 they overlap, at 0 their centres coincide.
/// Symmetric, and informative however deep the overlap.
///
/// The bracket is as narrow as `options` ask, relative to `max(1, s)`, or the status says that it
/// is not. `warm` is read and then replaced by the hint for the next query of this pair.
///
/// Of solids with several parts it is the least over the pairs of parts, each of which grows about
/// its own centre: the smallest s at which a grown part of `a` touches a grown part of `b`. About
/// one common centre it would not be a measure of proximity: a union is not star-shaped about any
/// point in general, so it does not grow in place, may leave what it touched before, and would not
/// overlap if s < 1. Parts that contain their centres only ever grow, so that here, too, s > 1 if
/// and only if the solids are apart. It depends on how a solid is cut into parts.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Options, Pose, WarmStart, growth_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let pose = Pose::from_quaternion(Vector3::new(0.75, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let s = growth_distance(&crate_, &Pose::identity(), &ball, &pose, &Options::default(), &mut WarmStart::default());
/// assert!((s.value() - 0.5).abs() < 1e-9); // half a crate and half a ball meet at x = 0.5
///
/// let row = Compound::new("row", vec![crate_, Body::ball("far", Vector3::new(-5.0, 0.0, 0.0), 0.5)?])?;
/// let t = growth_distance(&row, &Pose::identity(), &ball, &pose, &Options::default(), &mut WarmStart::default());
/// assert!((t.value() - s.value()).abs() < 1e-9 && !t.tied); // the crate is the first to touch
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn growth_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    if let ([a], [b]) = (a.parts(), b.parts()) {
        return between((a, pose_a), (b, pose_b), options, warm);
    }
    let (own_a, own_b) = (only_node(a.circumscribed()), only_node(b.circumscribed()));
    let (own_centers_a, own_centers_b) = (only_centers(a.parts()), only_centers(b.parts()));
    let of_a = (a.parts(), nodes(a, &own_a), centers(a, &own_centers_a));
    let of_b = (b.parts(), nodes(b, &own_b), centers(b, &own_centers_b));
    first_to_touch((of_a, pose_a), (of_b, pose_b), options, warm)
}

/// Parts with the nodes of their tree, and their centres.
type Parts<'a> = (&'a [Body], &'a [PartNode], &'a [PartCenters]);

fn first_to_touch(
    ((a, nodes_a, centers_a), pose_a): (Parts<'_>, &Pose),
    ((b, nodes_b, centers_b), pose_b): (Parts<'_>, &Pose),
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    let seen = SeenFrame::new(pose_a, pose_b);
    let bound = |i: usize, j: usize| NodeBound::of(growth_bound(&seen, &centers_a[i], &centers_b[j]));
    let trees = TreePair::new(nodes_a, nodes_b, bound);
    let found = nearest(&trees, &StopCriterion::NARROW, Recalled::NOTHING, warm, |(i, j), _, hint| {
        between((&a[i], pose_a), (&b[j], pose_b), options, hint)
    });
    let narrow = found.best.upper - found.lower <= options.accuracy() * found.best.upper.max(1.0);
    let (lower, tied, iterations) = (found.lower, found.tied, found.iterations);
    GrowthDistance { status: Status::of(narrow), lower, tied, iterations, ..found.best }
}

/// Lower bound of the growth distance of any two parts in two nodes.
///
/// A part lies in the ball of its reach R about its centre, and grown by s in that of s R: where
/// two touch, `|Δ| <= s (R_A + R_B)`. Of all parts in two nodes |Δ| is at least the gap between two
/// balls that contain the centres, and R at most the largest reach. Where those balls meet, the
/// quotient is negative: it bounds nothing, and still says which nodes are likelier.
pub(super) fn growth_bound(seen: &SeenFrame, of_a: &PartCenters, of_b: &PartCenters) -> f64 {
    let (of_a, of_b) = (&of_a.growth, &of_b.growth);
    let quotient = seen.gap(&of_a.ball, &of_b.ball) / (of_a.reach + of_b.reach);
    quotient - CULLING_SLACK * quotient.abs()
}
