//! Lower bounds of distances from planes. Along a direction n the bodies are apart by at least
//! `n·(a - b) - h_A(-n) - h_B(n)`, a and b their interior points and h their heights above these.
//! No polynomial is evaluated.

use super::culling::{CULLING_SLACK, across};
use crate::body::Body;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use nalgebra::Vector3;

/// Two bodies as planes between them are tried.
pub(in crate::measure) struct Separation<'a> {
    of_a: (&'a Body, &'a Pose),
    of_b: (&'a Body, &'a Pose),
    /// From B's interior point to A's, world frame, metres.
    between: Vector3<f64>,
    /// Bound of its error, and of what the directions' rotations are off by, metres.
    error: f64,
}

impl<'a> Separation<'a> {
    pub(in crate::measure) fn new(of_a: (&'a Body, &'a Pose), of_b: (&'a Body, &'a Pose)) -> Self {
        let ((a, pose_a), (b, pose_b)) = (of_a, of_b);
        let (between, apart, error) = across((pose_a, a.interior_point()), (pose_b, b.interior_point()));
        // Every point of a body is within its diameter of its interior point.
        let reach = 2.0 * (a.circumscribed().radius + b.circumscribed().radius);
        Self { of_a, of_b, between, error: error + ROTATION_ERROR * reach + CULLING_SLACK * (apart + reach) }
    }

    /// From B's interior point to A's, world frame, metres.
    pub(in crate::measure) fn between(&self) -> &Vector3<f64> {
        &self.between
    }

    /// Lower bound of the distance, metres, by planes across n, which points from B to A; world
    /// frame, of any length. Negative where they do not separate.
    pub(in crate::measure) fn along(&self, n: &Vector3<f64>) -> f64 {
        let ((a, pose_a), (b, pose_b)) = (self.of_a, self.of_b);
        // Normals of hints have length 1 up to rounding only.
        let Some(n) = n.try_normalize(0.0).filter(|n| n.norm() < 2.0) else { return f64::NEG_INFINITY };
        let height_a = a.height(&-pose_a.rotation().inverse_transform_vector(&n));
        let height_b = b.height(&pose_b.rotation().inverse_transform_vector(&n));
        n.dot(&self.between) - height_a - height_b - self.error
    }
}

#[cfg(test)]
mod tests {
    use super::Separation;
    use crate::measure::tests::{random_pose, zoo};
    use crate::measure::{Options, WarmStart, distance};
    use sublevel_testkit::Seeded;

    #[test]
    fn planes_bound_the_distance_and_are_close_along_its_normal() {
        let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
        let (mut near, mut count) = (0, 0);
        for seed in 0..2000 {
            let mut random = Seeded(58_000 + seed);
            let bodies = &zoos[(seed % 6) as usize];
            let (a, b) =
                (&bodies[random.next() as usize % bodies.len()], &bodies[random.next() as usize % bodies.len()]);
            let reach = a.circumscribed().radius + b.circumscribed().radius;
            let far = reach * 3_f64.powf(random.signed());
            let (pose_a, pose_b) = (random_pose(&mut random, 0.1), random_pose(&mut random, far));
            let truth = distance(a, &pose_a, b, &pose_b, &Options::default(), &mut WarmStart::default());
            let planes = Separation::new((a, &pose_a), (b, &pose_b));
            for _ in 0..20 {
                let n = random.unit() * (1.0 + random.signed());
                assert!(planes.along(&n) <= truth.upper, "seed {seed}");
            }
            if let Some(n) = truth.normal.filter(|_| truth.lower > 0.0) {
                let bound = planes.along(&n);
                assert!(bound <= truth.upper, "seed {seed}");
                assert!(planes.along(&(n * 1.5)) <= truth.upper, "seed {seed}");
                count += 1;
                near += u32::from(truth.upper - bound < 0.02 * reach);
            }
        }
        assert!(count > 800 && f64::from(near) > 0.95 * f64::from(count), "{near} of {count}");
    }
}
