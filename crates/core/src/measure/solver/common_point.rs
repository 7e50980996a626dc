//! Whether a point lies in both bodies of a pair.

use crate::measure::frames::vector::V3;
use crate::measure::solver::initial_guess::middle;
use crate::measure::solver::tangent_newton::Side;
use crate::polynomial::{Simd, WithSimd, dispatch};

/// A point from the centre of A's normalization on, in A's frame, metres.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct CommonPoint {
    pub(in crate::measure) v: V3<f64>,
    /// Whether it is proven to lie in both bodies; else it seems to, but for rounding.
    pub(in crate::measure) proven: bool,
}

impl CommonPoint {
    /// A point between x of A and y of B that lies in both, or seems to.
    #[inline(always)]
    pub(in crate::measure) fn between<S: Simd>(
        simd: S,
        sides: (&Side<'_, f64>, &Side<'_, f64>),
        x: V3<f64>,
        y: V3<f64>,
    ) -> Option<Self> {
        Self::at(sides, middle(simd, sides.0.body(), sides.1.body(), x, y))
    }

    /// Such a point if it is proven to lie in both.
    #[inline(always)]
    pub(in crate::measure) fn proven_between<S: Simd>(
        simd: S,
        sides: (&Side<'_, f64>, &Side<'_, f64>),
        x: V3<f64>,
        y: V3<f64>,
    ) -> Option<Self> {
        Self::between(simd, sides, x, y).filter(|common| common.proven)
    }

    /// The point, if it lies in both bodies or seems to.
    // Compiled once, and not with each method that asks.
    #[inline(never)]
    pub(in crate::measure) fn at((a, b): (&Side<'_, f64>, &Side<'_, f64>), v: V3<f64>) -> Option<Self> {
        dispatch(Containment { a, b, v })
    }
}

/// The question as vectorized work.
struct Containment<'a> {
    a: &'a Side<'a, f64>,
    b: &'a Side<'a, f64>,
    v: V3<f64>,
}

impl WithSimd for Containment<'_> {
    type Output = Option<CommonPoint>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<CommonPoint> {
        let v = self.v;
        let mut proven = true;
        for side in [self.a, self.b] {
            let [computed, surely] = side.highest(simd, v);
            if !(computed < 1.0) {
                return None;
            }
            proven &= surely <= 1.0;
        }
        Some(CommonPoint { v, proven })
    }
}

#[cfg(test)]
mod tests {
    use crate::body::Body;
    use crate::measure::Pose;
    use crate::measure::solver::tangent_newton::{Relative, Side};
    use crate::polynomial::Scalar;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;
    use sublevel_testkit::bodies::{e, zoo};
    use sublevel_testkit::reference::Solid;
    use sublevel_testkit::reference::big::{Big, big, double};

    /// The bound of the constraints at points about the surface of a body, from inside to outside
    /// by down to the last bits, against 200 bits: from near and far poses, where the rounding of
    /// the pose decides.
    #[test]
    fn bounds_at_a_point_hold_to_the_last_bits() {
        let (zoo, frame) = (zoo(), e(1.0, 1.0, 1.0));
        let own = |json: String| Body::from_json(&json).expect("a body");
        let (bodies, home) = (zoo.iter().map(|body| own(body.to_json())).collect::<Vec<_>>(), own(frame.to_json()));
        let (mut above, mut widest, mut count) = (0, 0.0_f64, 0);
        for seed in 0..600 {
            let mut random = Seeded(97_000 + seed);
            let k = random.index(zoo.len());
            let far = 10_f64.powf(3.0 * random.signed());
            let placed = [random.pose(0.5), random.pose(far)];
            let poses = placed.map(|pose| {
                Pose::from_quaternion(*pose.translation(), pose.rotation().coords.into()).expect("the same pose")
            });
            let relative = Relative::<f64>::new(Scalar, &home, &poses[0], &bodies[k], &poses[1]);
            let side = Side::away(Scalar, &bodies[k], 0, &relative);
            let exact = Solid::new(&zoo[k], &placed[1], &Vector3::zeros(), 1.0);
            let seen_from = Solid::new(&frame, &placed[0], &Vector3::zeros(), 1.0);
            let inner = poses[1].transform_point(bodies[k].interior_point()) - poses[0].translation();
            let inner = poses[0].rotation().inverse_transform_vector(&inner);
            let direction = random.unit() * (3.0 * bodies[k].circumscribed().radius);
            let at = |share: f64| -> [f64; 3] { (inner + direction * share).into() };
            // Where the bound passes 1.
            let (mut inside, mut outside) = (0.0, 1.0);
            for _ in 0..60 {
                let middle = 0.5 * (inside + outside);
                let [_, bound] = side.highest(Scalar, at(middle));
                *if bound <= 1.0 { &mut inside } else { &mut outside } = middle;
            }
            for off in [0.0, 1e-15, 1e-12, 1e-9, -1e-15, -1e-12, -1e-6] {
                let v = at(inside + off);
                let [computed, bound] = side.highest(Scalar, v);
                if bound.is_nan() {
                    continue;
                }
                let truth: Big = exact.largest(&seen_from.placed(&v.into()));
                assert!(truth <= big(bound), "seed {seed} {}: {computed} {bound}", zoo[k].name());
                above += u32::from(truth > big(computed));
                widest = widest.max((bound - double(&truth)) / (1.0 + far / bodies[k].circumscribed().radius));
                count += 1;
            }
        }
        println!("{above} of {count} values above what was computed; widest bound {widest:e}");
        // Without the bounds many points would be taken for common ones that are not.
        assert!(above > 500 && widest < 1e-9, "{above} {widest:e}");
    }
}
