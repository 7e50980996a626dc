//! Level distance `d(A‖B) = min p_A(x)` over x in B, p the largest constraint.

mod answer;
mod over_shape;
mod pair;
mod saturated;
mod search;
#[cfg(test)]
mod tests;

use crate::body::{Ball, Body, Centers, PartCenters, PartNode, Solid};
use crate::measure::bounds::culling::CULLING_SLACK;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::other_parts::Recalled;
use crate::measure::pairwise_minimum::nearest;
use crate::measure::part_pairs::{NodeBound, SeenFrame, TreePair, centers, nodes, only_centers, only_node};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
pub use answer::LevelDistance;
use pair::between;

/// Level distance of `a` over `b`: the smallest value that the stored polynomial of `a` (the
/// largest of its constraints) takes on `b`. Above 1 the bodies are apart, at 1 they touch, below 1
/// they overlap; it is not symmetric.
///
/// The bracket is as narrow as `options` ask, relative to `max(1, |d|)`, or the status says that it
/// is not. When the minimiser of `a`'s polynomial lies in `b`, the answer is its minimum
/// ([`Body::min_value`]) and says no more about depth. Derivatives are by the envelope theorem: at
/// the minimiser x the gradients of both bodies balance, `g_a + μ g_b = 0`. `warm` is read and then
/// replaced by the hint for the next query of this pair in this order.
///
/// Of solids with several parts it is the least over the pairs of parts, the polynomial of a union
/// being the least of those of its parts: one part of `a` and the part of `b` where it is lowest,
/// to which witness, multiplier and `saturated` belong.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Options, Pose, WarmStart, level_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let d = level_distance(&ball, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((d.value() - 4.0).abs() < 1e-8); // |x|² is 4 at (2, 0, 0)
/// assert!((d.gradient_b.linear - Vector3::new(4.0, 0.0, 0.0)).norm() < 1e-6); // and its slope there 4
///
/// let pair = Compound::new("pair", vec![ball.clone(), Body::ball("far", Vector3::new(0.0, 5.0, 0.0), 1.0)?])?;
/// let e = level_distance(&pair, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((e.value() - d.value()).abs() < 1e-8 && !e.tied);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn level_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    if let ([a], [b]) = (a.parts(), b.parts()) {
        return between((a, pose_a), (b, pose_b), options, warm);
    }
    let (own_a, own_b) = (only_node(a.circumscribed()), only_node(b.circumscribed()));
    let own_centers = only_centers(a.parts());
    let (nodes_a, nodes_b, centers) = (nodes(a, &own_a), nodes(b, &own_b), centers(a, &own_centers));
    let (of_a, of_b) = ((a.parts(), nodes_a), (b.parts(), nodes_b));
    lowest((of_a, centers, pose_a), (of_b, pose_b), options, warm)
}

/// Parts with the nodes of their tree.
type Parts<'a> = (&'a [Body], &'a [PartNode]);

fn lowest(
    ((a, nodes_a), centers, pose_a): (Parts<'_>, &[PartCenters], &Pose),
    ((b, nodes_b), pose_b): (Parts<'_>, &Pose),
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    let seen = SeenFrame::new(pose_a, pose_b);
    let bound = |i: usize, j: usize| level_bound(&seen, &centers[i], &nodes_b[j].ball);
    let trees = TreePair::new(nodes_a, nodes_b, bound);
    let found = nearest(&trees, &StopCriterion::NARROW, Recalled::NOTHING, warm, |(i, j), _, hint| {
        between((&a[i], pose_a), (&b[j], pose_b), options, hint)
    });
    let narrow = found.best.upper - found.lower <= options.accuracy() * found.best.upper.abs().max(1.0);
    let (lower, tied, iterations) = (found.lower, found.tied, found.iterations);
    LevelDistance { status: Status::of(narrow), lower, tied, iterations, ..found.best }
}

/// Lower bound of the level distance of any part in a node of A over any part in a ball of B.
///
/// Along a ray from its interior point c the largest constraint p of a part is convex, with p(c) at
/// most m < 1, and 1 at a distance of at most the part's reach. So at r, t >= 1 times as far as
/// that,
///
/// ```text
/// p >= p(c) + (1 - p(c)) t >= m + (1 - m) t,
/// ```
///
/// the second because t >= 1, so that the smaller p(c), the larger the left side. That increases
/// with t and decreases with m: the largest m and reach of the parts in a node, and the smallest r,
/// from a ball that contains their interior points, bound all of them. More than a line is not to
/// be had of convexity alone, and the reach is that of the longest axis: of elongated parts the
/// bound is far below the level, and hardly any pair is left out (`few_of_many_parts_are_touched`);
/// of round ones, and of parts much farther away than others, it leaves out what it can, for less
/// than two bounds a pair. Nearer than the reach nothing is proven, and the nodes come in the order
/// of t, which is at most 1, as what is proven never is.
pub(super) fn level_bound(seen: &SeenFrame, of_a: &PartCenters, of_b: &Ball) -> NodeBound {
    let PartCenters { interior: Centers { ball, reach }, min_value, .. } = of_a;
    let times = seen.gap(ball, of_b) / reach * (1.0 - CULLING_SLACK);
    if times > 1.0 {
        NodeBound::of(min_value + (1.0 - min_value) * times - CULLING_SLACK * (1.0 + min_value.abs()) * times)
    } else {
        NodeBound { lower: f64::NEG_INFINITY, order: times }
    }
}
