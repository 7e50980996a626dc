//! Bounds of distances by balls: no polynomial is evaluated.

use crate::body::Body;
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use nalgebra::Vector3;

/// A vector from a point y of B to a point x of A, its length and a bound of their errors.
pub(in crate::measure) fn across(
    (pose_a, x): (&Pose, &Vector3<f64>),
    (pose_b, y): (&Pose, &Vector3<f64>),
) -> (Vector3<f64>, f64, f64) {
    let offset = pose_a.translation() - pose_b.translation();
    let vector = offset + (pose_a.transform_direction(x) - pose_b.transform_direction(y));
    let size = offset.norm() + x.norm() + y.norm();
    (vector, vector.norm(), RELATIVE_ERROR * size)
}

/// Lower bound of the distance from the circumscribed balls; negative where they overlap.
pub(in crate::measure) fn ball_gap((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> f64 {
    let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
    let (_, apart, error) = across((pose_a, &ball_a.center), (pose_b, &ball_b.center));
    let reach = ball_a.radius + ball_b.radius;
    apart - reach - 8.0 * f64::EPSILON * (apart + reach) - error
}

/// Upper bound of a distance, metres, with points that attain it; world frame.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct InnerGap {
    /// 0 where balls inside both bodies have a point in common.
    pub(in crate::measure) upper: f64,
    pub(in crate::measure) witness_a: Vector3<f64>,
    pub(in crate::measure) witness_b: Vector3<f64>,
    /// Unit vector from B to A; none where the upper bound is 0.
    pub(in crate::measure) normal: Option<Vector3<f64>>,
}

/// Upper bound of the distance from the balls about the interior points inside both bodies.
pub(in crate::measure) fn inner_gap((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> InnerGap {
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
    InnerGap { upper: upper.max(0.0), witness_a, witness_b, normal }
}

/// Relative slack of cheap bounds, dimensionless: many times their rounding, which is a few units
/// of 2^-52.
///
/// Below 1e-15 a bound could exceed what it bounds; a larger value decides fewer questions without
/// a solve. Pinned by `slacks_cover_the_roundings_they_are_counted_for` and
/// `centres_are_as_far_apart_as_their_slack_allows`.
pub(in crate::measure) const CULLING_SLACK: f64 = 1e-14;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::tests::{random_pose, zoo};
    use crate::measure::{Options, WarmStart, distance};
    use sublevel_testkit::Seeded;

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
            assert!(ball_gap((a, &pose_a), (b, &pose_b)) <= truth.upper, "seed {seed}");
            let bound = inner_gap((a, &pose_a), (b, &pose_b));
            assert!(bound.upper >= truth.lower, "seed {seed}");
            let apart = (bound.witness_a - bound.witness_b).norm();
            assert!((apart - bound.upper).abs() < 1e-12 * (1.0 + far), "seed {seed}: {bound:?}");
            for (body, pose, x) in [(a, &pose_a, bound.witness_a), (b, &pose_b, bound.witness_b)] {
                let x = pose.rotation().inverse_transform_vector(&(x - pose.translation()));
                assert!(body.value(&x) <= 1.0 + 1e-12, "seed {seed}: {bound:?}");
            }
        }
    }
}
