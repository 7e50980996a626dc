//! Signed distance from a solid or a capsule to a half-space, and on which side of a threshold it
//! is.
//!
//! The signed distance is `min n·x - offset` over the solid. Where it is positive it is the
//! Euclidean distance, since the nearest point of the half-space lies along n. Where it is negative
//! its magnitude is the penetration depth: a translation t separates exactly if `n·t` makes up for
//! it, and the shortest such t is along n. So it takes the height of the solid along -n
//! ([`crate::measure::solver::support_point`]), in closed form for boxes, cylinders, balls and
//! capsules.

mod answer;
mod capsule;
mod capsule_decision;
mod decision;
mod set;
mod solid;

pub use answer::HalfSpaceDistance;
pub use capsule::distance_of_capsule_to_half_space;
pub use capsule_decision::{capsule_nearer_to_half_space_than, overlap_of_capsule_with_half_space};
pub use decision::{SignedThresholdError, nearer_to_half_space_than, overlap_with_half_space};
pub use set::{HalfSpace, HalfSpaceError};

use crate::body::Solid;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::WarmStart;
use solid::distance_until;

/// Signed distance of a solid at `pose` from a half-space: positive apart, zero in contact, minus
/// the penetration depth in overlap.
///
/// The bracket is as narrow as `options` ask, relative to the circumradius of the solid, or the
/// status says that it is not. `warm` is read and then replaced by the hint for the next query.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{HalfSpace, Options, Pose, WarmStart, distance_to_half_space};
///
/// let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 1.0, 2.0))?;
/// let floor = HalfSpace::new(Vector3::z(), -1.5)?;
/// let found = distance_to_half_space(&egg, &Pose::identity(), &floor, &Options::default(), &mut WarmStart::default());
/// assert!((found.value() + 0.5).abs() < 1e-8); // half a metre deep
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_to_half_space(
    solid: &impl Solid,
    pose: &Pose,
    half_space: &HalfSpace,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> HalfSpaceDistance {
    distance_until((solid, pose), half_space, StopCriterion::NARROW, options, warm)
}

#[cfg(test)]
mod tests;
