//! Signed distance from a body to a capsule: all points within a radius of a segment.
//!
//! Where the segment lies outside of the body at the distance d, the signed distance of the capsule
//! is `d - radius`: no translation shorter than the difference takes them apart, or brings them
//! into contact, for a ball adds its radius to the support function along every direction. Of a
//! smooth body it is found by Newton's method ([`super::solver::exact_shape`]), of a box or a
//! cylinder in the same way with their closed forms, of a ball or another capsule in closed form,
//! of a body with several constraints by Newton's method with an active set
//! ([`super::solver::edge_newton`]), or else by the projection of the segment on it
//! ([`super::solver::projection`]). Where none of these proves it, the distance of the segment's
//! points, a convex function of the place along it, has its least value between the last two places
//! where it fell and where it rose; the planes that prove the distances there bound it from below.

mod answer;
mod axes;
mod bounds;
mod capsules;
mod capsules_decision;
mod decision;
mod pair;
mod shape;
mod solid;

use crate::body::Solid;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::WarmStart;
pub use answer::CapsuleDistance;
pub use capsules::distance_of_capsules;
pub use capsules_decision::{capsules_nearer_than, capsules_within_margin, overlap_of_capsules};
pub use decision::{nearer_to_capsule_than, overlap_with_capsule, within_margin_of_capsule};
pub(in crate::measure) use pair::Problem;
pub use shape::{Capsule, CapsuleError};
use solid::distance_until;

/// Signed distance of a solid at `pose` from a capsule at `capsule_pose` (both to the world frame):
/// positive apart, zero in contact, minus the penetration depth in overlap as long as the axis of
/// the capsule is outside of the solid.
///
/// The bracket is as narrow as `options` ask, relative to the smaller of both circumradii, or the
/// status says that it is not. `warm` is read and then replaced by the hint for the next query.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Capsule, Options, Pose, WarmStart, distance_to_capsule};
///
/// let crate_ = Body::cuboid("crate", Vector3::new(0.5, 0.5, 0.5))?;
/// let forearm = Capsule::new(0.1, 0.3)?;
/// let beside = Pose::from_quaternion(Vector3::new(1.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let (options, mut warm) = (Options::default(), WarmStart::default());
/// let origin = Pose::identity();
/// let found = distance_to_capsule(&crate_, &origin, &forearm, &beside, &options, &mut warm);
/// assert!((found.value() - 0.4).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_to_capsule(
    solid: &impl Solid,
    pose: &Pose,
    capsule: &Capsule,
    capsule_pose: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> CapsuleDistance {
    distance_until((solid, pose), (capsule, capsule_pose), StopCriterion::NARROW, options, warm)
}

#[cfg(test)]
mod tests;
