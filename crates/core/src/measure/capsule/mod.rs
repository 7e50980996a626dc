//! Signed distance from a body to a capsule: all points within a radius of a segment.
//!
//! Where the segment lies outside of the body at the distance d, the signed distance of the capsule
//! is `d - radius`: no translation shorter than the difference takes them apart, or brings them
//! into contact, for a ball adds its radius to the support function along every direction. Of a
//! smooth body it is found by Newton's method ([`super::solver::exact_shape`]), of a box, a
//! cylinder or a ball in closed form. Of others the distance of the segment's points, a convex
//! function of the place along it, has its least value between the last two places where it fell
//! and where it rose; the planes that prove the distances there bound it from below.

mod answer;
mod bounds;
mod decision;
mod pair;
mod shape;
mod solid;

use crate::body::{ClosedForm, Solid};
use crate::measure::bounds::culling::CULLING_SLACK;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::solver::exact_shape::{ShapeDistance, between_shapes};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
pub use answer::CapsuleDistance;
pub use decision::{nearer_to_capsule_than, overlap_with_capsule};
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

/// Signed distance of two capsules where they stand: positive apart, minus the penetration depth in
/// overlap as long as their axes do not meet. The witnesses are those of the first and of the
/// second, the normal leads from the second to the first.
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
    let (form_a, form_b) =
        (ClosedForm::capsule(a.radius_m(), a.half_height_m()), ClosedForm::capsule(b.radius_m(), b.half_height_m()));
    let radii = a.radius_m() + b.radius_m();
    let Ok(found) = between_shapes((&form_a, pose_a), (&form_b, pose_b), None, (tolerance, options)) else {
        let slack = (CULLING_SLACK + ROTATION_ERROR) * (between + a.reach_m() + b.reach_m());
        let (witness, other) = (*pose_a.translation(), *pose_b.translation());
        return CapsuleDistance {
            status: Status::BracketWide,
            lower: (between - a.reach_m() - b.reach_m() - slack).max(-radii),
            upper: between - radii + slack,
            witness,
            witness_of_capsule: other,
            normal: None,
            tied: true,
            iterations: options.max_iterations(),
        };
    };
    let ShapeDistance { lower, upper, witness_a, witness_b, normal, steps, .. } = found;
    CapsuleDistance {
        status: Status::of(upper - lower <= tolerance),
        lower,
        upper,
        witness: witness_a,
        witness_of_capsule: witness_b,
        normal: normal.try_normalize(0.0),
        tied: false,
        iterations: steps,
    }
}

#[cfg(test)]
mod tests;
