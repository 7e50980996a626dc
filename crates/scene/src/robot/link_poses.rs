//! Where links are, as poses of objects.

use nalgebra::{Isometry3, Translation3};
use sublevel_core::measure::{Pose, PoseError};
use sublevel_robot::PlaceError;

/// Rounding of one product of poses and one normalisation, per metre of what they move.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// A pose as kinematics take it.
pub(crate) fn isometry(pose: &Pose) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::from(*pose.translation()), *pose.rotation())
}

/// What kinematics give as a pose: its quaternion is normalised.
///
/// # Errors
/// A link that is too far away to have a pose.
pub(crate) fn pose_of(isometry: &Isometry3<f64>) -> Result<Pose, PoseError> {
    let coords = isometry.rotation.coords;
    Pose::from_quaternion(isometry.translation.vector, (coords / coords.norm()).into())
}

/// Bound of how far points within `reach_m` of the origin of a link are from where exact arithmetic
/// on the joint values puts them, metres; for points of what the link holds, too, with the way to
/// them in `reach_m`.
pub(crate) fn link_error_m(link: &Isometry3<f64>, error: &PlaceError, reach_m: f64) -> f64 {
    error.within_m(reach_m) + ROUNDING * (reach_m + link.translation.vector.norm())
}
