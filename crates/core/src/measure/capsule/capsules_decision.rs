//! Yes-or-no questions about two capsules, decided before their distance is known: by the balls
//! around them, by points of their axes and planes between these, and else by its closed form.

use super::answer::CapsuleDistance;
use super::axes::{Axis, bounds_of_axes, of_axes};
use super::capsules::distance_of_capsules;
use super::shape::Capsule;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::overlap::{Decision, ThresholdError, WithinMargin, check, decision};
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::stop_criterion::StopCriterion;

/// Whether two capsules at their poses (to the world frame) have a point in common.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::{Capsule, Decision, Pose, overlap_of_capsules};
///
/// let limb = Capsule::new(0.05, 0.2)?;
/// let at = |x| Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]);
/// assert_eq!(overlap_of_capsules(&limb, &at(0.0)?, &limb, &at(0.09)?), Decision::Yes);
/// assert_eq!(overlap_of_capsules(&limb, &at(0.0)?, &limb, &at(0.11)?), Decision::No);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn overlap_of_capsules(a: &Capsule, pose_a: &Pose, b: &Capsule, pose_b: &Pose) -> Decision {
    decide((a, pose_a), (b, pose_b), 0.0)
}

/// Whether the distance of two capsules is below `threshold` metres.
///
/// # Errors
/// A threshold that is negative or not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::{Capsule, Decision, Pose, capsules_nearer_than};
///
/// let limb = Capsule::new(0.05, 0.2)?;
/// let beside = Pose::from_quaternion(Vector3::new(0.3, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let test = |t| capsules_nearer_than(&limb, &Pose::identity(), &limb, &beside, t);
/// assert_eq!(test(0.21)?, Decision::Yes);
/// assert_eq!(test(0.19)?, Decision::No);
/// assert!(test(f64::NAN).is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn capsules_nearer_than(
    a: &Capsule,
    pose_a: &Pose,
    b: &Capsule,
    pose_b: &Pose,
    threshold: f64,
) -> Result<Decision, ThresholdError> {
    check(threshold)?;
    if threshold == 0.0 {
        // Nothing is nearer than that, however deep.
        return Ok(Decision::No);
    }
    // Below the threshold is at most the number before it.
    Ok(decide((a, pose_a), (b, pose_b), threshold.next_down()))
}

/// The signed distance of two capsules as [`distance_of_capsules`] gives it, unless it is proven to
/// exceed `margin` metres: then it is not worked out.
///
/// # Errors
/// A margin that is negative or not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::{Capsule, Options, Pose, WithinMargin, capsules_within_margin};
///
/// let limb = Capsule::new(0.05, 0.2)?;
/// let beside = Pose::from_quaternion(Vector3::new(0.3, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let test = |m| capsules_within_margin(&limb, &Pose::identity(), &limb, &beside, m, &Options::default());
/// assert!(matches!(test(0.21)?, WithinMargin::Within(found) if (found.value() - 0.2).abs() < 1e-8));
/// assert!(matches!(test(0.19)?, WithinMargin::Beyond { lower } if lower > 0.19));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn capsules_within_margin(
    a: &Capsule,
    pose_a: &Pose,
    b: &Capsule,
    pose_b: &Pose,
    margin: f64,
    options: &Options<'_>,
) -> Result<WithinMargin<CapsuleDistance>, ThresholdError> {
    check(margin)?;
    let (of_a, of_b) = (Axis::of_capsule(a, pose_a), Axis::of_capsule(b, pose_b));
    let [lower, _] = bounds_of_axes(&of_a, &of_b, &StopCriterion::beyond(margin));
    if lower > margin {
        return Ok(WithinMargin::Beyond { lower });
    }
    let found = distance_of_capsules(a, pose_a, b, pose_b, options);
    Ok(if found.lower > margin { WithinMargin::Beyond { lower: found.lower } } else { WithinMargin::Within(found) })
}

/// Whether the signed distance is at most this, metres.
fn decide((a, pose_a): At<'_, Capsule>, (b, pose_b): At<'_, Capsule>, at_most: f64) -> Decision {
    let (a, b) = (Axis::of_capsule(a, pose_a), Axis::of_capsule(b, pose_b));
    let goal = StopCriterion::compare(at_most);
    let early = bounds_of_axes(&a, &b, &goal);
    if goal.met(early[0], early[1]) {
        return decision(early, at_most);
    }
    // How narrow a bracket is asked for changes its status only.
    let found = of_axes(&a, &b, 0.0);
    decision([found.lower.max(early[0]), found.upper.min(early[1])], at_most)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::tests::random_pose;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    fn random_capsule(random: &mut Seeded) -> Capsule {
        let [radius, half] = [0.3, 1.0].map(|size| size * 4_f64.powf(random.signed()));
        match random.next() % 6 {
            0 => Capsule::new(0.0, half),
            1 => Capsule::new(radius, 0.0),
            2 => Capsule::new(1e-6 * radius, 1e3 * half),
            _ => Capsule::new(radius, half),
        }
        .unwrap()
    }

    /// A pose beside another: parallel axes, crossing ones, ends that face each other, and any.
    fn beside(random: &mut Seeded, pose: &Pose, far: f64) -> Pose {
        let turned = match random.next() % 4 {
            0 => *pose,
            1 => {
                let quarter =
                    nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::FRAC_PI_2);
                Pose::from_quaternion(Vector3::zeros(), (pose.rotation() * quarter).coords.into()).unwrap()
            }
            _ => random_pose(random, 0.0),
        };
        turned.with_translation(pose.translation() + random.unit() * far)
    }

    /// Decisions agree with the bracket of the distance, at thresholds on both sides of it, down to
    /// 1e-12 of the sizes.
    #[test]
    fn decisions_of_capsules_agree_with_the_distance() {
        let (mut met, mut early) = ([0; 3], 0);
        for seed in 0..6000 {
            let mut random = Seeded(93_000 + seed);
            let (a, b) = (random_capsule(&mut random), random_capsule(&mut random));
            let reach = a.reach_m() + b.reach_m();
            let pose_a = random_pose(&mut random, if seed % 3 == 0 { 1e3 * reach } else { reach });
            let far = reach * 2.0 * random.positive();
            let pose_b = beside(&mut random, &pose_a, far);
            let truth = distance_of_capsules(&a, &pose_a, &b, &pose_b, &Options::default());
            let label = format!("seed {seed}, {a:?}, {b:?}: {truth:?}");
            check_decision(overlap_of_capsules(&a, &pose_a, &b, &pose_b), &truth, 0.0, &label);
            let size = reach + pose_a.translation().norm() + truth.upper.abs();
            let about = truth.upper.max(0.0);
            for off in [-0.5, -0.01, -1e-6, -1e-12, 0.0, 1e-12, 1e-6, 0.01, 1.0] {
                let threshold = about + off * size;
                let nearer = capsules_nearer_than(&a, &pose_a, &b, &pose_b, threshold);
                if threshold < 0.0 {
                    assert!(nearer.is_err(), "{label}");
                    continue;
                }
                if threshold == 0.0 {
                    assert_eq!(nearer, Ok(Decision::No), "{label}");
                    continue;
                }
                met[check_decision(nearer.unwrap(), &truth, threshold.next_down(), &label)] += 1;
                let (of_a, of_b) = (Axis::of_capsule(&a, &pose_a), Axis::of_capsule(&b, &pose_b));
                let goal = StopCriterion::compare(threshold.next_down());
                let [lower, upper] = bounds_of_axes(&of_a, &of_b, &goal);
                assert!(lower <= truth.upper && truth.lower <= upper, "{label}: {lower} {upper}");
                early += u32::from(goal.met(lower, upper));
                match capsules_within_margin(&a, &pose_a, &b, &pose_b, threshold, &Options::default()).unwrap() {
                    WithinMargin::Beyond { lower } => assert!(lower > threshold && lower <= truth.upper, "{label}"),
                    WithinMargin::Within(found) => {
                        assert!(found.lower <= threshold, "{label}");
                        assert!((found.lower, found.upper) == (truth.lower, truth.upper), "{label}: {found:?}");
                    }
                }
            }
        }
        println!("{met:?} met, {early} early");
        let all: u32 = met.iter().sum();
        assert!(met[0] > 10_000 && met[1] > 5_000 && met[2] < 6_000 && early > all / 2, "{met:?}, {early} early");
    }

    /// What a decision says must not be against a bracket; its index.
    fn check_decision(found: Decision, truth: &CapsuleDistance, at_most: f64, label: &str) -> usize {
        match found {
            Decision::Yes => {
                assert!(truth.lower <= at_most, "{label} at most {at_most}");
                0
            }
            Decision::No => {
                assert!(truth.upper > at_most, "{label} not at most {at_most}");
                1
            }
            Decision::Undecided { lower, upper } => {
                let is_open = truth.lower <= at_most && at_most < truth.upper;
                assert!(is_open && lower <= upper, "{label} undecided at {at_most}: {lower} {upper}");
                2
            }
        }
    }

    #[test]
    fn what_is_no_threshold_is_refused() {
        let (limb, here) = (Capsule::new(0.1, 0.2).unwrap(), Pose::identity());
        for bad in [-1e-300, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(capsules_nearer_than(&limb, &here, &limb, &here, bad).is_err(), "{bad}");
            assert!(capsules_within_margin(&limb, &here, &limb, &here, bad, &Options::default()).is_err(), "{bad}");
        }
        assert_eq!(capsules_nearer_than(&limb, &here, &limb, &here, 0.0), Ok(Decision::No));
        assert_eq!(overlap_of_capsules(&limb, &here, &limb, &here), Decision::Yes);
        // Two points at the same place have one in common.
        let dot = Capsule::POINT;
        assert_ne!(overlap_of_capsules(&dot, &here, &dot, &here), Decision::No);
    }
}
