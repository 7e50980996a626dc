//! Penetration depth: the shortest translation that takes two overlapping solids apart.

mod answer;
mod closed_form;
mod pair;
#[cfg(test)]
mod tests;

use crate::body::Solid;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::other_parts::Recalled;
use crate::measure::pairwise_minimum::{Least, nearest};
use crate::measure::part_pairs::{SeenFrame, ball_gaps, nodes, only_node};
use crate::measure::signed::separating_translation::{self, Start, Starts};
use crate::measure::solver::depth::local_search::solid_tolerance;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
pub use answer::Penetration;
use pair::between;

/// Penetration depth of two bodies at their poses (body to world): 0 when they are apart or touch.
///
/// The bracket is as narrow as `options` ask, relative to the depth
/// ([`Options::with_depth_accuracy`]), or the status says that it is not: with many equally short
/// directions and an accuracy beyond about 1e-4 the iterations end first. `upper` is
/// as accurate as a distance wherever its direction is the best: the bracket is about the others.
/// `warm` is read and then replaced by the hint for the next query of this pair.
///
/// Of solids with several parts it is the shortest translation that takes every part of one off
/// every part of the other. It is at least the depth of any pair of parts, and at most the length
/// of a translation proven to separate them all; the shortest such is a local search's, so that
/// where parts interlock the bracket may stay wide, and `directions` counts those of all pairs.
///
/// ```
/// use nalgebra::{UnitQuaternion, Vector3};
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Decision, Options, Pose, WarmStart, overlap, penetration};
///
/// let a = Body::cuboid("a", Vector3::new(1.0, 1.0, 1.0))?;
/// let b = Body::ball("b", Vector3::zeros(), 0.5)?;
/// let pose = Pose::from_quaternion(Vector3::new(1.25, 0.1, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let depth = penetration(&a, &Pose::identity(), &b, &pose, &Options::default(), &mut WarmStart::default());
/// assert!((depth.value() - 0.25).abs() < 1e-8 && depth.lower > 0.2497);
/// assert!((depth.direction.unwrap() + Vector3::x()).norm() < 1e-6); // a has to move back
///
/// // Between two plates the ball has to leave sideways, not through one of them.
/// let plate = |x: f64| Body::cuboid("plate", Vector3::new(0.1, 2.0, 2.0))?.moved(&UnitQuaternion::identity(), &Vector3::new(x, 0.0, 0.0));
/// let slot = Compound::new("slot", vec![plate(0.55)?, plate(-0.55)?])?;
/// let high = Pose::from_quaternion(Vector3::new(0.0, 0.0, 1.9), [0.0, 0.0, 0.0, 1.0])?;
/// let depth = penetration(&b, &high, &slot, &Pose::identity(), &Options::default(), &mut WarmStart::default());
/// let apart = Pose::from_quaternion(high.translation() + depth.direction.unwrap() * depth.upper, [0.0, 0.0, 0.0, 1.0])?;
/// assert_ne!(overlap(&b, &apart, &slot, &Pose::identity(), &Options::default(), &mut WarmStart::default()), Decision::Yes);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn penetration(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Penetration {
    let (parts_a, parts_b) = (a.parts(), b.parts());
    if let ([a], [b]) = (parts_a, parts_b) {
        return between((a, pose_a), (b, pose_b), options, warm);
    }
    let (mut starts, mut directions) = (Starts::default(), 0);
    let (own_a, own_b) = (only_node(a.circumscribed()), only_node(b.circumscribed()));
    let trees = ball_gaps(nodes(a, &own_a), nodes(b, &own_b), SeenFrame::new(pose_a, pose_b));
    let Least { best, iterations, .. } =
        nearest(&trees, &StopCriterion::NARROW, Recalled::NOTHING, warm, |pair, _, hint| {
            let found = between((&parts_a[pair.0], pose_a), (&parts_b[pair.1], pose_b), options, hint);
            directions += found.directions;
            if let Some(direction) = found.direction {
                starts.push(Start { pair, direction, depth: found.upper });
            }
            found
        });
    if starts.is_empty() {
        return Penetration { directions, iterations, ..best };
    }
    let found = separating_translation::separate((a, pose_a), (b, pose_b), &starts, best.lower, options);
    let (lower, upper) = (best.lower, found.length);
    let narrow = upper - lower <= solid_tolerance(a, b, options, upper);
    Penetration {
        status: Status::of(narrow),
        lower,
        upper,
        direction: Some(found.direction),
        witness_a: found.contacts[0].x,
        witness_b: found.contacts[0].y,
        // A second direction for the deepest pair is a tie if that pair decides the depth.
        tied: found.tied || best.tied && narrow,
        directions,
        iterations: iterations + found.iterations,
    }
}
