//! Questions that a bracket answers before it is narrow: overlap, nearer than a threshold, within a
//! margin.
//!
//! Two balls have a formula. Else balls inside and around come first, then planes across a few
//! directions, whose heights are looked up. What touches a box or a cylinder, or does not, the
//! least value of the other body's polynomial over that shape decides; of two such shapes, a point
//! of both or a plane between them. The search for the distance, which stops as soon as its bracket
//! decides, comes last.

use crate::body::Solid;
use crate::measure::distance::{Distance, distance_until};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::WarmStart;

/// Answer to a yes-or-no question, proven or open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decision {
    /// Yes: proven.
    Yes,
    /// No: proven.
    No,
    /// The distance is too close to the threshold to decide; its proven bracket in metres.
    Undecided {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}

/// Distance within a margin, or proven beyond it.
#[derive(Clone, Copy, Debug)]
pub enum WithinMargin<T = Distance> {
    /// The distance, which is not proven to exceed the margin.
    Within(T),
    /// The distance exceeds the margin; metres.
    Beyond {
        /// Proven lower bound of the distance.
        lower: f64,
    },
}

/// A threshold or margin that is no length.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{0} m is not a distance to compare with; give a finite number that is not negative")]
pub struct ThresholdError(pub f64);

/// Whether two solids have a point in common. `warm` as in [`crate::measure::distance`], with which
/// it can be shared.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Decision, Options, Pose, WarmStart, overlap};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let at = |x| Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]);
/// let test = |x| Ok::<_, Box<dyn std::error::Error>>(overlap(
///     &ball, &Pose::identity(), &ball, &at(x)?, &Options::default(), &mut WarmStart::default(),
/// ));
/// assert_eq!(test(1.99)?, Decision::Yes);
/// assert_eq!(test(2.01)?, Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn overlap(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Decision {
    decide(&distance_until((a, pose_a), (b, pose_b), &StopCriterion::compare(0.0), options, warm), 0.0)
}

/// Whether the distance of two solids is below `threshold` metres: the search ends as soon as its
/// bracket decides. `warm` as in [`crate::measure::distance`].
///
/// # Errors
/// A threshold that is negative or not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Decision, Options, Pose, WarmStart, nearer_than};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(2.5, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let test = |t| nearer_than(&ball, &Pose::identity(), &ball, &apart, t, &Options::default(), &mut WarmStart::default());
/// assert_eq!(test(0.6)?, Decision::Yes);
/// assert_eq!(test(0.4)?, Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn nearer_than(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    threshold: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<Decision, ThresholdError> {
    check(threshold)?;
    // Below the threshold is at most the number before it.
    let at_most = threshold.next_down();
    Ok(decide(&distance_until((a, pose_a), (b, pose_b), &StopCriterion::compare(at_most), options, warm), at_most))
}

/// The distance of two solids, as accurate as [`crate::measure::distance`] gives it, unless it is
/// proven to exceed `margin` metres: then it is not worked out. `warm` as in
/// [`crate::measure::distance`].
///
/// # Errors
/// A margin that is negative or not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, WithinMargin, within_margin};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(2.5, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let test = |m| within_margin(&ball, &Pose::identity(), &ball, &apart, m, &Options::default(), &mut WarmStart::default());
/// assert!(matches!(test(0.6)?, WithinMargin::Within(distance) if (distance.value() - 0.5).abs() < 1e-8));
/// assert!(matches!(test(0.4)?, WithinMargin::Beyond { lower } if lower > 0.4));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn within_margin(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    margin: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<WithinMargin, ThresholdError> {
    check(margin)?;
    let found = distance_until((a, pose_a), (b, pose_b), &StopCriterion::beyond(margin), options, warm);
    Ok(if found.lower > margin { WithinMargin::Beyond { lower: found.lower } } else { WithinMargin::Within(found) })
}

pub(super) fn check(threshold: f64) -> Result<(), ThresholdError> {
    if threshold >= 0.0 && threshold.is_finite() { Ok(()) } else { Err(ThresholdError(threshold)) }
}

fn decide(found: &Distance, at_most: f64) -> Decision {
    decision([found.lower, found.upper], at_most)
}

/// Whether a distance in a bracket, negative in overlap, is at most this, metres.
pub(super) fn decision([lower, upper]: [f64; 2], at_most: f64) -> Decision {
    if upper <= at_most {
        Decision::Yes
    } else if lower > at_most {
        Decision::No
    } else {
        Decision::Undecided { lower: lower.max(0.0), upper: upper.max(0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;
    use crate::measure::Status;
    use crate::measure::tests::{random_pose, zoo};
    use crate::measure::{distance, level_distance};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    #[test]
    fn decisions_agree_with_the_distance() {
        let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
        let mut met = [0; 3];
        for seed in 0..1500 {
            let mut random = Seeded(31_000 + seed);
            let bodies = &zoos[(seed % 6) as usize];
            let (a, b) =
                (&bodies[random.next() as usize % bodies.len()], &bodies[random.next() as usize % bodies.len()]);
            let reach = a.circumscribed().radius + b.circumscribed().radius;
            let (pose_a, far) = (random_pose(&mut random, 1.0), reach * 2_f64.powf(1.5 * random.signed()));
            let shift = pose_a.translation() + random.unit() * far;
            let pose_b = Pose::from_quaternion(shift, random_pose(&mut random, 0.0).rotation().coords.into()).unwrap();
            let options = Options::default();
            let truth = distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
            let size = a.circumscribed().radius.min(b.circumscribed().radius);
            // Cold, and with the hint of another answer.
            let mut warms = [WarmStart::default(); 2];
            distance(a, &pose_a, b, &random_pose(&mut random, far), &options, &mut warms[1]);
            if seed % 5 == 0 {
                level_distance(b, &pose_a, a, &pose_b, &options, &mut warms[1]);
            }
            for mut warm in warms {
                let label = format!("seed {seed} {}-{}: {truth:?}", a.name(), b.name());
                match overlap(a, &pose_a, b, &pose_b, &options, &mut warm) {
                    Decision::Yes => assert!(truth.lower == 0.0, "{label}"),
                    Decision::No => assert!(truth.upper > 0.0, "{label}"),
                    open => assert!(truth.lower <= 0.0 && truth.upper > 0.0, "{label}: {open:?}"),
                }
                for factor in [0.5, 0.99, 1.0, 1.01, 2.0] {
                    let threshold = factor * truth.upper;
                    let nearer = nearer_than(a, &pose_a, b, &pose_b, threshold, &options, &mut warm).unwrap();
                    met[match nearer {
                        Decision::Yes => 0,
                        Decision::No => 1,
                        _ => 2,
                    }] += 1;
                    match nearer {
                        Decision::Yes => assert!(truth.lower < threshold, "{label} below {threshold}"),
                        Decision::No => assert!(truth.upper >= threshold, "{label} not below {threshold}"),
                        Decision::Undecided { lower, upper } => {
                            assert!(
                                lower <= threshold && upper >= threshold && upper - lower <= 1e-9 * size,
                                "{label} {nearer:?} {threshold}"
                            );
                        }
                    }
                    match within_margin(a, &pose_a, b, &pose_b, threshold, &options, &mut warm).unwrap() {
                        WithinMargin::Beyond { lower } => assert!(lower > threshold && lower <= truth.upper, "{label}"),
                        WithinMargin::Within(found) => {
                            assert!(
                                found.lower <= threshold && found.status == Status::Converged,
                                "{label}: {found:?}"
                            );
                            assert!(found.lower <= truth.upper && truth.lower <= found.upper, "{label}: {found:?}");
                        }
                    }
                }
            }
        }
        assert!(met[0] > 3000 && met[1] > 3000 && met[2] < 3000, "{met:?}");
    }

    /// Close to contact planes across the gap that a search has found spare it evaluations.
    #[test]
    fn decisions_near_contact_take_fewer_evaluations_than_distances() {
        let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
        let (mut of_distances, mut of_decisions, mut count) = (0, 0, 0);
        for seed in 0..1500 {
            let mut random = Seeded(33_000 + seed);
            let bodies = &zoos[seed as usize % zoos.len()];
            let smooth: Vec<_> = bodies.iter().filter(|body| body.is_smooth()).collect();
            let [a, b] = [(); 2].map(|()| smooth[random.next() as usize % smooth.len()]);
            let reach = a.circumscribed().radius + b.circumscribed().radius;
            let (pose_a, apart) = (random_pose(&mut random, 0.1), random_pose(&mut random, 2.5 * reach));
            let options = Options::default();
            let measured = |pose_b: &Pose| distance(a, &pose_a, b, pose_b, &options, &mut WarmStart::default());
            let found = measured(&apart);
            let Some(n) = found.normal else { continue };
            let gap = 0.01 * reach * (0.1 + random.positive());
            let near = apart.with_translation(apart.translation() + n * (found.upper - gap));
            let goal = StopCriterion::compare(0.0);
            let decided = distance_until((a, &pose_a), (b, &near), &goal, &options, &mut WarmStart::default());
            assert!(decided.lower > 0.0, "seed {seed}: {decided:?}");
            of_distances += measured(&near).iterations;
            of_decisions += decided.iterations;
            count += 1;
        }
        println!("{of_decisions} evaluations of decisions, {of_distances} of distances, {count} pairs");
        assert!(count > 1000 && 4 * of_decisions < 3 * of_distances, "{of_decisions} of {of_distances}");
    }

    #[test]
    fn thresholds_are_checked() {
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let here = Pose::identity();
        for bad in [-1.0, f64::NAN, f64::INFINITY] {
            let options = Options::default();
            assert!(nearer_than(&ball, &here, &ball, &here, bad, &options, &mut WarmStart::default()).is_err());
            assert!(within_margin(&ball, &here, &ball, &here, bad, &options, &mut WarmStart::default()).is_err());
        }
        // Touching counts as overlap as soon as rounding allows to say so; nothing is nearer
        // than 0.
        let options = Options::default();
        let inside = nearer_than(&ball, &here, &ball, &here, 0.0, &options, &mut WarmStart::default());
        assert_eq!(inside, Ok(Decision::No));
    }
}
