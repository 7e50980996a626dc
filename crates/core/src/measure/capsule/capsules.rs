//! The signed distance of two capsules.

use super::answer::CapsuleDistance;
use super::axes::{Axis, of_axes};
use super::shape::Capsule;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;

/// Signed distance of two capsules where they stand: positive apart, minus the penetration depth in
/// overlap, which is the sum of the radii where their axes meet. The witnesses are those of the
/// first and of the second, the normal leads from the second to the first.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::{Capsule, Options, Pose, distance_of_capsules};
///
/// let limb = Capsule::new(0.05, 0.2)?;
/// let beside = Pose::from_quaternion(Vector3::new(0.3, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let found = distance_of_capsules(&limb, &Pose::identity(), &limb, &beside, &Options::default());
/// assert!((found.value() - 0.2).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_of_capsules(
    a: &Capsule,
    pose_a: &Pose,
    b: &Capsule,
    pose_b: &Pose,
    options: &Options<'_>,
) -> CapsuleDistance {
    let size = [a.reach_m(), b.reach_m()].into_iter().filter(|&reach| reach > 0.0).fold(f64::INFINITY, f64::min);
    let between = (pose_a.translation() - pose_b.translation()).norm();
    // Two points have no size but their distance.
    let tolerance = options.accuracy() * if size.is_finite() { size } else { between };
    of_axes(&Axis::of_capsule(a, pose_a), &Axis::of_capsule(b, pose_b), tolerance)
}
