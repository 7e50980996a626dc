//! The signed distance of a capsule from a half-space: that of the lower end of its axis, less the
//! radius.

use super::answer::HalfSpaceDistance;
use super::set::HalfSpace;
use crate::measure::capsule::Capsule;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::status::Status;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Signed distance of a capsule at `pose` (to the world frame) from a half-space: positive apart,
/// minus the penetration depth in overlap. It is tied where the axis lies along the plane, up to
/// rounding: all of its points are as near then.
///
/// The bracket is that of rounding; the status says whether it is as narrow as `options` ask,
/// relative to the capsule's reach, `r + h`, or for a point to how far it or the plane is from the
/// origin.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::{Capsule, HalfSpace, Options, Pose, distance_of_capsule_to_half_space};
///
/// let (limb, floor) = (Capsule::new(0.1, 0.3)?, HalfSpace::new(Vector3::z(), 0.0)?);
/// let upright = Pose::from_quaternion(Vector3::new(0.0, 0.0, 1.0), [0.0, 0.0, 0.0, 1.0])?;
/// let found = distance_of_capsule_to_half_space(&limb, &upright, &floor, &Options::default());
/// assert!((found.value() - 0.6).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_of_capsule_to_half_space(
    capsule: &Capsule,
    pose: &Pose,
    half_space: &HalfSpace,
    options: &Options<'_>,
) -> HalfSpaceDistance {
    let (normal, offset) = (half_space.normal(), half_space.offset());
    let Lowest { end, slope, slack, bracket: [lower, upper] } = lowest(capsule, pose, half_space);
    let reach = capsule.reach_m();
    // A point has no size of its own.
    let size = if reach > 0.0 { reach } else { pose.translation().norm().max(offset.abs()) };
    HalfSpaceDistance {
        status: Status::of(upper - lower <= options.accuracy() * size),
        lower,
        upper,
        witness: end - normal * capsule.radius_m(),
        tied: capsule.half_height_m() > 0.0 && slope.abs() <= slack,
        iterations: 0,
    }
}

/// Where the axis of a capsule is lowest above a half-space, world frame, metres.
pub(super) struct Lowest {
    /// The lower end of the axis.
    end: Vector3<f64>,
    /// Height of the end of the axis on its own z axis above the centre.
    slope: f64,
    /// Bound of the rounding of the height.
    slack: f64,
    /// Proven bracket of the signed distance of the capsule.
    pub(super) bracket: [f64; 2],
}

/// The height of a capsule above a half-space: that of the lower end of its axis, less the radius.
pub(super) fn lowest(capsule: &Capsule, pose: &Pose, half_space: &HalfSpace) -> Lowest {
    let (normal, offset) = (half_space.normal(), half_space.offset());
    let axis = pose.transform_direction(&Vector3::z()) * capsule.half_height_m();
    let slope = axis.dot(normal);
    let end = pose.translation() - if slope > 0.0 { axis } else { -axis };
    let height = normal.dot(&end) - offset - capsule.radius_m();
    let coordinates = pose.translation().norm() + capsule.reach_m() + offset.abs();
    let slack = (ROTATION_ERROR + gamma(16)) * coordinates;
    Lowest { end, slope, slack, bracket: [height - slack, height + slack] }
}
