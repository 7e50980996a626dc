//! Signed distance: the distance of bodies that are apart, minus the penetration depth of those
//! that overlap.
//!
//! Both are one function: with the support functions h, the largest over all unit vectors n of
//! `-h_A(-n) - h_B(n)`, how far a plane across n parts the bodies. Its optimality system is that of
//! the distance with a distance of either sign, so Newton's method passes through contact without
//! noticing; x and y trade places along n. What differs is the proof: apart, any pair of points
//! bounds it from above; in overlap that takes all directions ([`crate::measure::penetration`]). Of
//! balls beside balls, boxes and cylinders, of boxes, of boxes and cylinders, and of parallel
//! cylinders, it has a closed form.

mod answer;
mod closed_form;
mod pair;
mod report;
pub(super) mod separating_translation;
#[cfg(test)]
mod tests;

use crate::body::Solid;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::other_parts::SeenSolids;
use crate::measure::pairwise_minimum::{Least, nearest};
use crate::measure::part_pairs::{ball_gaps, nodes, only_node};
use crate::measure::solver::depth::local_search::solid_tolerance;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
pub use answer::SignedDistance;
use pair::between;
use separating_translation::{Contact, SeparatingTranslation, Start, Starts};

/// Signed distance of body `a` at `pose_a` and body `b` at `pose_b` (body to world).
///
/// The bracket is as narrow as `options` ask: relative to the smaller body when they are apart, and
/// relative to the depth when they overlap ([`Options::with_depth_accuracy`]), where the value
/// itself is as accurate as a distance unless another direction is a better one within that
/// bracket. `warm` is read and then replaced by the hint for the next query of this pair; it
/// carries through contact.
///
/// Of solids with several parts it is their distance, or minus the depth of their overlap
/// ([`crate::measure::penetration`]), which is known from a local search: in overlap the bracket
/// may stay wide. There the gradients are those of all the pairs of parts that keep the solids
/// back, and the witnesses belong to the one that does so most.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Options, Pose, WarmStart, signed_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let mut warm = WarmStart::default();
/// for x in [1.75, 1.5, 1.25] {
///     let pose = Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
///     let answer = signed_distance(&ball, &pose, &crate_, &Pose::identity(), &Options::default(), &mut warm);
///     assert!((answer.value() - (x - 1.5)).abs() < 1e-8);
///     assert!((answer.gradients.unwrap()[0].linear - Vector3::x()).norm() < 1e-6);
/// }
///
/// let row = Compound::new("row", vec![crate_, Body::ball("far", Vector3::new(-5.0, 0.0, 0.0), 0.5)?])?;
/// let pose = Pose::from_quaternion(Vector3::new(1.25, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let answer = signed_distance(&ball, &pose, &row, &Pose::identity(), &Options::default(), &mut warm);
/// assert!((answer.value() + 0.25).abs() < 1e-8 && !answer.tied);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn signed_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> SignedDistance {
    let (parts_a, parts_b) = (a.parts(), b.parts());
    if let ([a], [b]) = (parts_a, parts_b) {
        return between((a, pose_a), (b, pose_b), options, warm);
    }
    let mut starts = Starts::default();
    let (own_a, own_b) = (only_node(a.circumscribed()), only_node(b.circumscribed()));
    let solids = SeenSolids::new((a, pose_a), (b, pose_b));
    let trees = ball_gaps(nodes(a, &own_a), nodes(b, &own_b), solids.seen);
    let found = nearest(
        &trees,
        &StopCriterion::NARROW,
        solids.recall(warm.others.as_ref(), warm.parts),
        warm,
        |pair, _, hint| {
            let found = between((&parts_a[pair.0], pose_a), (&parts_b[pair.1], pose_b), options, hint);
            if let Some(direction) = found.normal.filter(|_| found.lower <= 0.0) {
                starts.push(Start { pair, direction, depth: -found.lower });
            }
            found
        },
    );
    let Least { best, lower, tied, iterations, .. } = found;
    if !found.is_recalled {
        warm.others = Some(solids.kept(found.others, warm.parts));
    }
    if lower > 0.0 || starts.is_empty() {
        let status = Status::of(best.upper - lower <= solid_tolerance(a, b, options, 0.0));
        return SignedDistance { status, lower, tied: tied || best.tied, iterations, ..best };
    }
    let least = (-best.upper).max(0.0);
    let found = separating_translation::separate((a, pose_a), (b, pose_b), &starts, least, options);
    let (lower, upper) = (-found.length, best.upper);
    let narrow = upper - lower <= solid_tolerance(a, b, options, if upper < 0.0 { found.length } else { 0.0 });
    SignedDistance {
        status: Status::of(narrow),
        lower,
        upper,
        witness_a: found.contacts[0].x,
        witness_b: found.contacts[0].y,
        normal: Some(found.direction),
        gradients: Some(gradients(&found, pose_a, pose_b)),
        at_contact: lower <= 0.0 && upper >= 0.0,
        tied: found.tied || best.tied && narrow,
        iterations: iterations + found.iterations,
    }
}

/// Derivatives of minus the length of a translation with respect to both poses: each pair of parts
/// that touches adds its weighted normal, at the points where it does (envelope theorem).
fn gradients(found: &SeparatingTranslation, pose_a: &Pose, pose_b: &Pose) -> [Twist; 2] {
    found.contacts.iter().fold([Twist::ZERO; 2], |[a, b], Contact { weighted_normal, x, y }| {
        let of_a = Twist::of_gradient(*weighted_normal, x, pose_a.translation());
        let of_b = Twist::of_gradient(-weighted_normal, y, pose_b.translation());
        [a + of_a, b + of_b]
    })
}
