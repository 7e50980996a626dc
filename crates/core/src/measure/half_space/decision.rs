//! Yes-or-no questions about a solid and a half-space, decided before their distance is known: by
//! balls around and inside, by the table of heights, and by support points that are only as
//! accurate as the answer requires.

use super::set::HalfSpace;
use super::solid::distance_until;
use crate::body::Solid;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::overlap::{Decision, decision};
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::WarmStart;

/// A threshold that no signed distance can be compared with.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{0} m is not a signed distance to compare with; give a finite number")]
pub struct SignedThresholdError(pub f64);

/// Whether a solid at `pose` has a point in common with a half-space; the bracket of an open answer
/// is that of the signed distance. `warm` as in
/// [`crate::measure::distance_to_half_space`], with which it can be shared.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Decision, HalfSpace, Options, Pose, WarmStart, overlap_with_half_space};
///
/// let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 1.0, 2.0))?;
/// let test = |z| Ok::<_, Box<dyn std::error::Error>>(overlap_with_half_space(
///     &egg, &Pose::identity(), &HalfSpace::new(Vector3::z(), z)?, &Options::default(),
///     &mut WarmStart::default(),
/// ));
/// assert_eq!(test(-1.99)?, Decision::Yes);
/// assert_eq!(test(-2.01)?, Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn overlap_with_half_space(
    solid: &impl Solid,
    pose: &Pose,
    half_space: &HalfSpace,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Decision {
    decide((solid, pose), half_space, 0.0, options, warm)
}

/// Whether the signed distance of a solid from a half-space is below `threshold` metres, which may
/// be negative: then it asks for a depth. `warm` as in [`crate::measure::distance_to_half_space`].
///
/// # Errors
/// A threshold that is not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Decision, HalfSpace, Options, Pose, WarmStart, nearer_to_half_space_than};
///
/// let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 1.0, 2.0))?;
/// let floor = HalfSpace::new(Vector3::z(), -2.5)?;
/// let test = |t| {
///     let mut warm = WarmStart::default();
///     nearer_to_half_space_than(&egg, &Pose::identity(), &floor, t, &Options::default(), &mut warm)
/// };
/// assert_eq!(test(0.6)?, Decision::Yes);
/// assert_eq!(test(0.4)?, Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn nearer_to_half_space_than(
    solid: &impl Solid,
    pose: &Pose,
    half_space: &HalfSpace,
    threshold: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<Decision, SignedThresholdError> {
    Ok(decide((solid, pose), half_space, most_below(threshold)?, options, warm))
}

/// The largest signed distance below a threshold, metres: the number before it.
pub(super) fn most_below(threshold: f64) -> Result<f64, SignedThresholdError> {
    if threshold.is_finite() { Ok(threshold.next_down()) } else { Err(SignedThresholdError(threshold)) }
}

/// Whether the signed distance is at most this, metres.
fn decide(
    of_solid: At<'_, impl Solid>,
    half_space: &HalfSpace,
    at_most: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Decision {
    let found = distance_until(of_solid, half_space, StopCriterion::compare(at_most), options, warm);
    signed_decision([found.lower, found.upper], at_most)
}

/// Whether a signed distance in a bracket is at most this, metres.
pub(super) fn signed_decision([lower, upper]: [f64; 2], at_most: f64) -> Decision {
    match decision([lower, upper], at_most) {
        // Depths are distances here.
        Decision::Undecided { .. } => Decision::Undecided { lower, upper },
        decided => decided,
    }
}
