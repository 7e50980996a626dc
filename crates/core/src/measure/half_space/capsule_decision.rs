//! Yes-or-no questions about a capsule and a half-space, decided by the height of the lower end of
//! the capsule's axis: nothing but its rounding leaves them open.

use super::capsule::lowest;
use super::decision::{SignedThresholdError, most_below, signed_decision};
use super::set::HalfSpace;
use crate::measure::capsule::Capsule;
use crate::measure::frames::pose::Pose;
use crate::measure::overlap::Decision;

/// Whether a capsule at `pose` (to the world frame) has a point in common with a half-space; the
/// bracket of an open answer is that of the signed distance.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::overlap_of_capsule_with_half_space;
/// use sublevel_core::measure::{Capsule, Decision, HalfSpace, Pose};
///
/// let (limb, floor) = (Capsule::new(0.1, 0.3)?, HalfSpace::new(Vector3::z(), 0.0)?);
/// let at = |z| Pose::from_quaternion(Vector3::new(0.0, 0.0, z), [0.0, 0.0, 0.0, 1.0]);
/// assert_eq!(overlap_of_capsule_with_half_space(&limb, &at(0.39)?, &floor), Decision::Yes);
/// assert_eq!(overlap_of_capsule_with_half_space(&limb, &at(0.41)?, &floor), Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn overlap_of_capsule_with_half_space(capsule: &Capsule, pose: &Pose, half_space: &HalfSpace) -> Decision {
    signed_decision(lowest(capsule, pose, half_space).bracket, 0.0)
}

/// Whether the signed distance of a capsule at `pose` (to the world frame) from a half-space is
/// below `threshold` metres, which may be negative: then it asks for a depth.
///
/// # Errors
/// A threshold that is not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::capsule_nearer_to_half_space_than;
/// use sublevel_core::measure::{Capsule, Decision, HalfSpace, Pose};
///
/// let (limb, floor) = (Capsule::new(0.1, 0.3)?, HalfSpace::new(Vector3::z(), 0.0)?);
/// let upright = Pose::from_quaternion(Vector3::new(0.0, 0.0, 1.0), [0.0, 0.0, 0.0, 1.0])?;
/// let test = |t| capsule_nearer_to_half_space_than(&limb, &upright, &floor, t);
/// assert_eq!(test(0.61)?, Decision::Yes);
/// assert_eq!(test(0.59)?, Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn capsule_nearer_to_half_space_than(
    capsule: &Capsule,
    pose: &Pose,
    half_space: &HalfSpace,
    threshold: f64,
) -> Result<Decision, SignedThresholdError> {
    Ok(signed_decision(lowest(capsule, pose, half_space).bracket, most_below(threshold)?))
}
