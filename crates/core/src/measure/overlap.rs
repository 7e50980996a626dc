//! Questions that a bracket answers before it is narrow: overlap, nearer than a threshold, within a
//! margin.
//!
//! Balls come first, then the slabs of the normalized coordinates along a direction or two, then
//! the search for the distance, which stops as soon as its bracket decides.

use crate::body::{Body, MAX_CONSTRAINTS, Solid};
use crate::measure::bounds::duality_bounds::distance_lower;
use crate::measure::distance::{Distance, between};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::frames::query_frame::Pair;
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::warm::{Hint, WarmStart};
use crate::measure::{Status, union};
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Answer to a yes-or-no question, proven or open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decision {
    /// Yes: proven.
    Yes,
    /// No: proven.
    No,
    /// The distance is too close to the threshold to tell; its proven bracket in metres.
    Undecided {
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
}

/// Distance within a margin, or proven beyond it.
#[derive(Clone, Copy, Debug)]
pub enum WithinMargin {
    /// The distance, which is not proven to exceed the margin.
    Within(Distance),
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
    decide(&union::distance(a, pose_a, b, pose_b, &Goal::compare(0.0), options, warm), 0.0)
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
    Ok(decide(&union::distance(a, pose_a, b, pose_b, &Goal::compare(at_most), options, warm), at_most))
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
    let found = union::distance(a, pose_a, b, pose_b, &Goal::beyond(margin), options, warm);
    Ok(if found.lower > margin { WithinMargin::Beyond { lower: found.lower } } else { WithinMargin::Within(found) })
}

fn check(threshold: f64) -> Result<(), ThresholdError> {
    if threshold >= 0.0 && threshold.is_finite() { Ok(()) } else { Err(ThresholdError(threshold)) }
}

fn decide(found: &Distance, at_most: f64) -> Decision {
    if found.upper <= at_most {
        Decision::Yes
    } else if found.lower > at_most {
        Decision::No
    } else {
        Decision::Undecided { lower: found.lower, upper: found.upper }
    }
}

/// What a bracket has to say for a search to stop before it is narrow.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    /// The distance is at most this.
    pub(super) near: f64,
    /// The distance exceeds this.
    pub(super) far: f64,
}

impl Goal {
    /// Only a narrow bracket will do.
    pub(super) const NARROW: Self = Self { near: f64::NEG_INFINITY, far: f64::INFINITY };

    /// Which side of this distance.
    pub(super) fn compare(distance: f64) -> Self {
        Self { near: distance, far: distance }
    }

    /// A narrow bracket unless the distance exceeds this.
    pub(super) fn beyond(far: f64) -> Self {
        Self { far, ..Self::NARROW }
    }

    /// The same with lengths in units of so many metres, a power of two.
    pub(super) fn in_units_of(&self, unit: f64) -> Self {
        Self { near: self.near / unit, far: self.far / unit }
    }

    pub(super) fn is_narrow(&self) -> bool {
        self.near == f64::NEG_INFINITY && self.far == f64::INFINITY
    }

    /// Whether a narrow bracket is an answer, with all that comes with one, and not just a
    /// decision.
    pub(super) fn wants_answer(&self) -> bool {
        self.near == f64::NEG_INFINITY
    }

    #[inline]
    pub(super) fn met(&self, lower: f64, upper: f64) -> bool {
        upper <= self.near || lower > self.far
    }
}

/// Distance of two bodies as far as the goal needs it, cheapest bounds first. `warm` stays as it is
/// when they suffice.
#[inline]
pub(super) fn settle(
    of_a: (&Body, &Pose),
    of_b: (&Body, &Pose),
    goal: &Goal,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    if goal.is_narrow() {
        return between(of_a, of_b, goal, options, warm);
    }
    let mut bound = balls(of_a, of_b);
    if goal.met(bound.lower, bound.upper) {
        return bound;
    }
    bound.lower = bound.lower.max(slabs(of_a, of_b, &warm.hint));
    if goal.met(bound.lower, bound.upper) {
        return bound;
    }
    let found = between(of_a, of_b, goal, options, warm);
    // A search that stopped early may know less than the bounds it came after.
    let upper = if found.upper <= bound.upper { found } else { bound };
    Distance { lower: found.lower.max(bound.lower), status: found.status, iterations: found.iterations, ..upper }
}

/// A vector from a point y of B to a point x of A, its length and a bound of their errors.
pub(super) fn across(
    (pose_a, x): (&Pose, &Vector3<f64>),
    (pose_b, y): (&Pose, &Vector3<f64>),
) -> (Vector3<f64>, f64, f64) {
    let offset = pose_a.translation() - pose_b.translation();
    let vector = offset + (pose_a.transform_direction(x) - pose_b.transform_direction(y));
    let size = offset.norm() + x.norm() + y.norm();
    (vector, vector.norm(), (2.0 * ROTATION_ERROR + gamma(16)) * size)
}

/// Lower bound of the distance from the circumscribed balls; negative where they overlap.
pub(super) fn ball_gap((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> f64 {
    let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
    let (_, apart, error) = across((pose_a, &ball_a.center), (pose_b, &ball_b.center));
    let reach = ball_a.radius + ball_b.radius;
    apart - reach - 8.0 * f64::EPSILON * (apart + reach) - error
}

/// Bracket of the distance from the circumscribed balls and those about the interior points inside.
fn balls((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> Distance {
    let lower = ball_gap((a, pose_a), (b, pose_b));
    let (vector, apart, error) = across((pose_a, a.interior_point()), (pose_b, b.interior_point()));
    let reach = a.in_radius() + b.in_radius();
    let upper = apart - reach + 8.0 * f64::EPSILON * (apart + reach) + error;
    let (from_a, from_b) = (pose_a.transform_point(a.interior_point()), pose_b.transform_point(b.interior_point()));
    let (witness_a, witness_b, normal) = if upper > 0.0 {
        let n = vector / apart;
        (from_a - n * a.in_radius(), from_b + n * b.in_radius(), n.try_normalize(0.0))
    } else {
        let common = from_a - vector * (a.in_radius() / reach);
        (common, common, None)
    };
    Distance {
        status: Status::BracketWide,
        lower: lower.max(0.0),
        upper: upper.max(0.0),
        witness_a,
        witness_b,
        normal,
        active_a: ActiveConstraints::default(),
        active_b: ActiveConstraints::default(),
        parts: [0, 0],
        tied: false,
        iterations: 0,
    }
}

/// Lower bound of the distance in metres from the bounds of the normalized coordinates, along the
/// line of the centres and the normal of the last answer: no polynomial is evaluated.
fn slabs((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose), hint: &Hint) -> f64 {
    let pair = Pair::new(a, pose_a, b, pose_b);
    let x = pair.a_to_query(&a.normalization().center);
    let y = pair.b_to_query(&b.normalization().center);
    let none = [0.0; MAX_CONSTRAINTS];
    let along = |n: &Vector3<f64>| distance_lower(&pair, &x, &y, n, &none, &none);
    let mut lower = along(&(x - y));
    if let Hint::Apart { normal_a, .. } = hint {
        lower = lower.max(along(normal_a));
    }
    lower * pair.unit()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::tests::{random_pose, unit, zoo};
    use crate::measure::{distance, level_distance};
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
            let shift = pose_a.translation() + unit(&mut random) * far;
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

    /// Each early bound holds whatever the search finds, and its witnesses attain it.
    #[test]
    fn early_bounds_are_bounds() {
        let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
        for seed in 0..1000 {
            let mut random = Seeded(57_000 + seed);
            let bodies = &zoos[(seed % 6) as usize];
            let (a, b) =
                (&bodies[random.next() as usize % bodies.len()], &bodies[random.next() as usize % bodies.len()]);
            let far = (a.circumscribed().radius + b.circumscribed().radius) * 3_f64.powf(random.signed());
            let (pose_a, pose_b) = (random_pose(&mut random, 0.1), random_pose(&mut random, far));
            let mut warm = WarmStart::default();
            let truth = distance(a, &pose_a, b, &pose_b, &Options::default(), &mut warm);
            let bound = balls((a, &pose_a), (b, &pose_b));
            let slabs = slabs((a, &pose_a), (b, &pose_b), &warm.hint);
            assert!(bound.lower <= truth.upper && slabs <= truth.upper, "seed {seed}");
            assert!(bound.upper >= truth.lower, "seed {seed}");
            let apart = (bound.witness_a - bound.witness_b).norm();
            assert!((apart - bound.upper).abs() < 1e-12 * (1.0 + far), "seed {seed}: {bound:?}");
            for (body, pose, x) in [(a, &pose_a, bound.witness_a), (b, &pose_b, bound.witness_b)] {
                let x = pose.rotation().inverse_transform_vector(&(x - pose.translation()));
                assert!(body.value(&x) <= 1.0 + 1e-12, "seed {seed}: {bound:?}");
            }
        }
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
        // Touching counts as overlap as soon as rounding allows to say so; nothing is nearer than 0.
        let options = Options::default();
        let inside = nearer_than(&ball, &here, &ball, &here, 0.0, &options, &mut WarmStart::default());
        assert_eq!(inside, Ok(Decision::No));
    }
}
