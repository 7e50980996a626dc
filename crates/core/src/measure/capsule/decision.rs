//! Yes-or-no questions about a solid and a capsule, decided before their distance is known: by
//! balls, by planes whose heights are looked up, and by a search that stops as soon as its bracket
//! decides.

use super::answer::CapsuleDistance;
use super::shape::Capsule;
use super::solid::distance_until;
use crate::body::Solid;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::overlap::{Decision, ThresholdError, WithinMargin, check, decision};
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::WarmStart;

/// Whether a solid at `pose` and a capsule at `capsule_pose` (both to the world frame) have a point
/// in common. `warm` as in [`crate::measure::distance_to_capsule`], with which it can be shared.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Capsule, Decision, Options, Pose, WarmStart, overlap_with_capsule};
///
/// let crate_ = Body::cuboid("crate", Vector3::new(0.5, 0.5, 0.5))?;
/// let forearm = Capsule::new(0.1, 0.3)?;
/// let at = |x| Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]);
/// let test = |x| Ok::<_, Box<dyn std::error::Error>>(overlap_with_capsule(
///     &crate_, &Pose::identity(), &forearm, &at(x)?, &Options::default(),
///     &mut WarmStart::default(),
/// ));
/// assert_eq!(test(0.59)?, Decision::Yes);
/// assert_eq!(test(0.61)?, Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn overlap_with_capsule(
    solid: &impl Solid,
    pose: &Pose,
    capsule: &Capsule,
    capsule_pose: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Decision {
    decide((solid, pose), (capsule, capsule_pose), 0.0, options, warm)
}

/// Whether the distance of a solid from a capsule is below `threshold` metres. `warm` as in
/// [`crate::measure::distance_to_capsule`].
///
/// # Errors
/// A threshold that is negative or not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Capsule, Decision, Options, Pose, WarmStart};
/// use sublevel_core::measure::nearer_to_capsule_than;
///
/// let crate_ = Body::cuboid("crate", Vector3::new(0.5, 0.5, 0.5))?;
/// let forearm = Capsule::new(0.1, 0.3)?;
/// let beside = Pose::from_quaternion(Vector3::new(1.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let (origin, options) = (Pose::identity(), Options::default());
/// let test = |t| {
///     let mut warm = WarmStart::default();
///     nearer_to_capsule_than(&crate_, &origin, &forearm, &beside, t, &options, &mut warm)
/// };
/// assert_eq!(test(0.41)?, Decision::Yes);
/// assert_eq!(test(0.39)?, Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn nearer_to_capsule_than(
    solid: &impl Solid,
    pose: &Pose,
    capsule: &Capsule,
    capsule_pose: &Pose,
    threshold: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<Decision, ThresholdError> {
    check(threshold)?;
    if threshold == 0.0 {
        // Nothing is nearer than that, however deep.
        return Ok(Decision::No);
    }
    // Below the threshold is at most the number before it.
    Ok(decide((solid, pose), (capsule, capsule_pose), threshold.next_down(), options, warm))
}

/// The signed distance of a solid from a capsule, as accurate as
/// [`crate::measure::distance_to_capsule`] gives it, unless it is proven to exceed `margin` metres:
/// then it is not worked out. `warm` as in [`crate::measure::distance_to_capsule`].
///
/// # Errors
/// A margin that is negative or not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Capsule, Options, Pose, WarmStart, WithinMargin};
/// use sublevel_core::measure::within_margin_of_capsule;
///
/// let crate_ = Body::cuboid("crate", Vector3::new(0.5, 0.5, 0.5))?;
/// let forearm = Capsule::new(0.1, 0.3)?;
/// let beside = Pose::from_quaternion(Vector3::new(1.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let (origin, options) = (Pose::identity(), Options::default());
/// let test = |m| {
///     let mut warm = WarmStart::default();
///     within_margin_of_capsule(&crate_, &origin, &forearm, &beside, m, &options, &mut warm)
/// };
/// assert!(matches!(test(0.5)?, WithinMargin::Within(found) if (found.value() - 0.4).abs() < 1e-8));
/// assert!(matches!(test(0.3)?, WithinMargin::Beyond { lower } if lower > 0.3));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn within_margin_of_capsule(
    solid: &impl Solid,
    pose: &Pose,
    capsule: &Capsule,
    capsule_pose: &Pose,
    margin: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<WithinMargin<CapsuleDistance>, ThresholdError> {
    check(margin)?;
    let goal = StopCriterion::beyond(margin);
    let found = distance_until((solid, pose), (capsule, capsule_pose), goal, options, warm);
    Ok(if found.lower > margin { WithinMargin::Beyond { lower: found.lower } } else { WithinMargin::Within(found) })
}

/// Whether the signed distance is at most this, metres.
fn decide(
    of_solid: At<'_, impl Solid>,
    of_capsule: At<'_, Capsule>,
    at_most: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Decision {
    let found = distance_until(of_solid, of_capsule, StopCriterion::compare(at_most), options, warm);
    decision([found.lower, found.upper], at_most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, Compound};
    use crate::measure::tests::{random_pose, zoo};
    use crate::measure::{Status, distance_to_capsule};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    /// Decisions of every kind of body agree with the distance, at thresholds on either side of it
    /// and of contact, with hints of the pose before and without.
    #[test]
    fn decisions_agree_with_the_distance() {
        let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
        let mut met = [0; 3];
        for seed in 0..3000 {
            let mut random = Seeded(91_000 + seed);
            let bodies = &zoos[(seed % 6) as usize];
            let body = &bodies[random.next() as usize % bodies.len()];
            let size = body.circumscribed().radius;
            let radius = size * 3_f64.powf(2.0 * random.signed());
            let half = if seed % 3 == 0 { 0.0 } else { size * 3_f64.powf(2.0 * random.signed()) };
            let capsule = Capsule::new(if seed % 7 == 1 { 0.0 } else { radius }, half).unwrap();
            let reach = size + capsule.reach_m();
            let (pose, capsule_pose) = (random_pose(&mut random, 0.1 * reach), random_pose(&mut random, reach));
            let options = Options::default();
            let truth = distance_to_capsule(body, &pose, &capsule, &capsule_pose, &options, &mut WarmStart::default());
            let label = format!("seed {seed}, {}: {truth:?}", body.name());
            let mut warm = WarmStart::default();
            for _ in 0..2 {
                match overlap_with_capsule(body, &pose, &capsule, &capsule_pose, &options, &mut warm) {
                    Decision::Yes => assert!(truth.lower <= 0.0, "{label}"),
                    Decision::No => assert!(truth.upper > 0.0, "{label}"),
                    Decision::Undecided { .. } => {
                        assert!(truth.lower <= 0.0 && truth.upper > 0.0, "{label}");
                    }
                }
                // What overlaps is nearer than anything but 0.
                let about = if truth.upper > 0.0 { truth.upper } else { size };
                for factor in [0.5, 0.99, 1.0, 1.01, 2.0] {
                    let threshold = factor * about;
                    let nearer =
                        nearer_to_capsule_than(body, &pose, &capsule, &capsule_pose, threshold, &options, &mut warm);
                    let index = match nearer.unwrap() {
                        Decision::Yes => {
                            assert!(truth.lower < threshold, "{label} below {threshold}");
                            0
                        }
                        Decision::No => {
                            assert!(truth.upper >= threshold, "{label} not below {threshold}");
                            1
                        }
                        Decision::Undecided { lower, upper } => {
                            let wide = upper - lower > 1e-9 * size && truth.status == Status::Converged;
                            assert!(lower <= threshold && upper >= threshold && !wide, "{label} {threshold}");
                            2
                        }
                    };
                    met[index] += 1;
                }
            }
        }
        assert!(met[0] > 3000 && met[1] > 8000 && met[2] < 6000, "{met:?}");
    }

    #[test]
    fn any_part_decides_and_thresholds_are_checked() {
        let at = |x: f64| Body::ball("part", Vector3::new(x, 0.0, 0.0), 1.0).unwrap();
        let row = Compound::new("row", vec![at(0.0), at(10.0), at(20.0)]).unwrap();
        let capsule = Capsule::new(0.25, 1.0).unwrap();
        let (origin, options) = (Pose::identity(), Options::default());
        // Nothing is nearer than 0.
        let inside = nearer_to_capsule_than(&row, &origin, &capsule, &origin, 0.0, &options, &mut WarmStart::default());
        assert_eq!(inside, Ok(Decision::No));
        let above = |x: f64, y: f64| Pose::identity().with_translation(Vector3::new(x, y, 0.0));
        for (x, y, expected) in [
            (10.0, 1.2, Decision::Yes),
            (10.0, 1.3, Decision::No),
            (5.0, 0.0, Decision::No),
            (20.0, 0.0, Decision::Yes),
        ] {
            let found =
                overlap_with_capsule(&row, &origin, &capsule, &above(x, y), &options, &mut WarmStart::default());
            assert_eq!(found, expected, "{x} {y}");
        }
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            let place = above(5.0, 0.0);
            let found =
                nearer_to_capsule_than(&row, &origin, &capsule, &place, bad, &options, &mut WarmStart::default());
            assert!(found.is_err(), "{bad}");
        }
    }
}
