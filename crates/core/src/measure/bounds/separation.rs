//! Lower bounds of distances from planes. Along a direction n the bodies are apart by at least
//! `n·(a - b) - h_A(-n) - h_B(n)`, a and b their interior points and h their heights above these.
//! No polynomial is evaluated.

use super::culling::CULLING_SLACK;
use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{
    M3, V3, add, apply, apply_symmetric, apply_transposed, cofactors, rows, times_transposed,
};
use crate::measure::solver::tangent_newton::Relative;
use crate::polynomial::Scalar;
use nalgebra::Vector3;

/// Two bodies as planes between them are tried; A's frame.
pub(in crate::measure) struct Separation<'a> {
    a: &'a Body,
    b: &'a Body,
    /// Rotation from B's frame to A's.
    rotation: M3<f64>,
    /// From B's interior point to A's, metres.
    between: Vector3<f64>,
    /// Bound of its error, and of what the directions' rotations are off by, metres.
    error: f64,
}

impl<'a> Separation<'a> {
    pub(in crate::measure) fn new((a, pose_a): (&'a Body, &Pose), (b, pose_b): (&'a Body, &Pose)) -> Self {
        Self::seen(a, b, &Relative::new(Scalar, a, pose_a, b, pose_b))
    }

    /// Of B where it stands as seen from A.
    pub(in crate::measure) fn seen(a: &'a Body, b: &'a Body, relative: &Relative<f64>) -> Self {
        let interior = |body: &Body| V3::from(body.interior_point() - body.normalization().center);
        let of_b = add::<Scalar, f64>(apply::<Scalar, f64>(&relative.rotation, interior(b)), relative.origin);
        let between = Vector3::from(interior(a)) - Vector3::from(of_b);
        // Every point of a body is within its diameter of its interior point.
        let reach = 2.0 * (a.circumscribed().radius + b.circumscribed().radius);
        let error = relative.displacement + CULLING_SLACK * (between.norm() + reach);
        Self { a, b, rotation: relative.rotation, between, error }
    }

    /// From B's interior point to A's, metres.
    pub(in crate::measure) fn between(&self) -> &Vector3<f64> {
        &self.between
    }

    /// About the normal across the gap, from B to A, of some length: that of the ellipsoid of the
    /// sum of both shapes, about B's interior point, through A's.
    pub(in crate::measure) fn facing(&self) -> Vector3<f64> {
        let of_a: M3<f64> = rows(Scalar, self.a.outline().shape());
        let of_b: M3<f64> = rows(Scalar, self.b.outline().shape());
        let turned = times_transposed::<Scalar, f64>(&self.rotation, &of_b);
        let of_b = times_transposed::<Scalar, f64>(&turned, &self.rotation);
        across_gap(|i, j| of_a[i][j] + of_b[i][j], &self.between)
    }

    /// Lower bound of the distance, metres, by planes across n, which points from B to A; of any
    /// length. Negative where they do not separate.
    pub(in crate::measure) fn along(&self, n: &Vector3<f64>) -> f64 {
        // Normals of hints have length 1 up to rounding only.
        let Some(n) = n.try_normalize(0.0).filter(|n| n.norm() < 2.0) else { return f64::NEG_INFINITY };
        let own_b = apply_transposed::<Scalar, f64>(&self.rotation, n.into()).into();
        n.dot(&self.between) - self.a.height(&-n) - self.b.height(&own_b) - self.error
    }
}

/// About the normal across the gap between two centres, of some length: that of the ellipsoid of
/// these entries through the way from the one to the other, metres.
#[inline(always)]
pub(in crate::measure) fn across_gap(entry: impl Fn(usize, usize) -> f64, way: &Vector3<f64>) -> Vector3<f64> {
    let sum = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    let (inverse, _) = cofactors(Scalar, sum);
    apply_symmetric::<Scalar, f64>(&inverse, (*way).into()).into()
}

#[cfg(test)]
mod tests {
    use super::Separation;
    use crate::body::Body;
    use crate::measure::tests::{random_pose, zoo};
    use crate::measure::{Options, Pose, WarmStart, distance};
    use nalgebra::{UnitQuaternion, Vector3};
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
            let Some((bound, upper)) = bounded((a, &pose_a), (b, &pose_b), &mut random, seed) else { continue };
            count += 1;
            near += u32::from(upper - bound < 0.02 * reach);
        }
        assert!(count > 800 && f64::from(near) > 0.95 * f64::from(count), "{near} of {count}");
    }

    /// Bodies far from the origins of their frames, poses far from that of the world, and both, so
    /// that the rounding of all of these is larger than what a table of heights adds.
    #[test]
    fn planes_bound_the_distance_far_from_the_origins() {
        let away = |is_far: bool, random: &mut Seeded| {
            random.unit() * if is_far { 10_f64.powf(5.0 + random.signed()) } else { 0.0 }
        };
        // Each where it is, and at five places far away.
        let bodies: Vec<[(Vector3<f64>, Body); 6]> = (0..6)
            .flat_map(|seed| zoo(&mut Seeded(seed)))
            .zip(60_000..)
            .map(|(body, seed)| {
                let mut random = Seeded(seed);
                std::array::from_fn(|place| {
                    let by = away(place > 0, &mut random);
                    (by, body.moved(&UnitQuaternion::identity(), &by).expect("a body"))
                })
            })
            .collect();
        let mut count = 0;
        for seed in 0..1200 {
            let mut random = Seeded(59_000 + seed);
            let mut draw = |is_far: bool| {
                let places = &bodies[random.index(bodies.len())];
                &places[if is_far { 1 + random.index(5) } else { 0 }]
            };
            let ((of_a, a), (of_b, b)) = (draw(seed % 2 == 0), draw(seed / 2 % 2 == 0));
            let of_both = away(seed / 4 % 2 == 0, &mut random);
            let reach = a.circumscribed().radius + b.circumscribed().radius;
            // Where the bodies are a few reaches from each other.
            let turned = [random_pose(&mut random, 0.0), random_pose(&mut random, 0.0)];
            let centers = [of_both, of_both + random.unit() * (reach * 3_f64.powf(random.signed()))];
            let place = |turned: &Pose, of_body: &Vector3<f64>, center: Vector3<f64>| {
                turned.with_translation(center - turned.transform_direction(of_body))
            };
            let (pose_a, pose_b) = (place(&turned[0], of_a, centers[0]), place(&turned[1], of_b, centers[1]));
            count += u32::from(bounded((a, &pose_a), (b, &pose_b), &mut random, seed).is_some());
        }
        assert!(count > 400, "{count}");
    }

    /// No plane shows more than the distance; what that across its normal shows, and the distance.
    fn bounded(
        (a, pose_a): (&Body, &Pose),
        (b, pose_b): (&Body, &Pose),
        random: &mut Seeded,
        seed: u64,
    ) -> Option<(f64, f64)> {
        let truth = distance(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default());
        let planes = Separation::new((a, pose_a), (b, pose_b));
        let along = |n: Vector3<f64>| planes.along(&pose_a.rotation().inverse_transform_vector(&n));
        for _ in 0..20 {
            let n = random.unit() * (1.0 + random.signed());
            assert!(along(n) <= truth.upper, "seed {seed}");
        }
        let n = truth.normal.filter(|_| truth.lower > 0.0)?;
        let bound = along(n);
        assert!(bound <= truth.upper && along(n * 1.5) <= truth.upper, "seed {seed}");
        Some((bound, truth.upper))
    }
}
