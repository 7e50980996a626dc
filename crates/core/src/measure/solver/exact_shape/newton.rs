//! Newton's method for the distance of a smooth body from a set with a closed form, in the tangent
//! plane of their normal.
//!
//! The nearest point x of the body `{g <= 1}` has `g(x) = 1` and `n(x) + λ ∇g(x) = 0`, with the
//! outward normal n of the set's offset surface there and `λ = -1 / (n·∇g)`. For steps
//! `dx = T α + n a` the normal turns by `T K α`, K the curvature of that surface, so that up to
//! terms of second order
//!
//! ```text
//! (W + K) α = r,    W = λ TᵀH T,   r = -λ Tᵀ(∇g + a H n),   a = (g(x) - 1) λ
//! ```
//!
//! with the straightened constraint of [`super::super::tangent_newton::newton`].
//!
//! Where the step leads to another feature of the set, or into it, K is that of the wrong one. Then
//! the point of the set is left free: about the foot `f = x + a n` the body's surface is `f + E α`
//! with `E = T - n rᵀ`, but for its curvature, which counts D times, the distance of f. The α
//! nearest to a point y of the set, and half the square of that distance, are
//!
//! ```text
//! α = -B⁻¹ Eᵀ (f - y),   (f - y)ᵀ M (f - y) / 2,   B = EᵀE + D W,   M = I - E B⁻¹ Eᵀ,
//! ```
//!
//! and y is where this is least over the set.

use super::projectable::{Offset, Projectable};
use crate::measure::frames::vector::{V3, add_scaled, apply_symmetric, dot, scaled, subtract};
use crate::measure::solver::tangent_newton::{Plane, SurfaceCurvature, Symmetric2, moved};
use crate::polynomial::Simd;

/// Least D relative to the distance of x, dimensionless.
///
/// Larger, steps near contact are shorter than they have to be; smaller, the curvature of a body
/// that is about to reach the set counts for nothing, or against it. It changes time only; no test
/// pins it.
const NEAREST: f64 = 0.1;

/// A step and where it leads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Move {
    /// Along the tangents and the normal where it starts.
    pub(super) step: V3<f64>,
    /// The set as seen from where it leads.
    pub(super) next: Offset,
    /// The part along the normal that the value asks for.
    pub(super) shift: f64,
    /// `(W + K)⁻¹` where it starts, metres.
    pub(super) compliance: Symmetric2<f64>,
}

/// The body's constraint along the tangents and the normal of a step.
pub(super) struct Linearized {
    /// The multiplier λ, metres.
    multiplier: f64,
    shift: f64,
    gradient: V3<f64>,
    pub(super) r: [f64; 2],
    pub(super) w: Symmetric2<f64>,
}

impl Linearized {
    #[inline(always)]
    pub(super) fn new<S: Simd>(_: S, plane: &Plane<f64>, bend: &SurfaceCurvature<f64>) -> Self {
        let g = plane.gradient;
        let multiplier = -1.0 / g[2];
        let mean = (0.5 * plane.value + 0.5).max(0.25);
        let shift = (plane.value - 1.0) * mean * multiplier;
        let straight = 1.0 - shift * g[2] / mean;
        let r = [
            -multiplier * (g[0] * straight + shift * bend.tilt[0]),
            -multiplier * (g[1] * straight + shift * bend.tilt[1]),
        ];
        Self { multiplier, shift, gradient: g, r, w: scaled::<S, f64>(bend.curvature, multiplier) }
    }

    /// The step with these tangential parts: along the normal the tangential part of the gradient,
    /// of second order, counts as well.
    #[inline(always)]
    pub(super) fn step(&self, alpha: [f64; 2]) -> V3<f64> {
        let g = self.gradient;
        [alpha[0], alpha[1], self.shift + self.multiplier * (g[0] * alpha[0] + g[1] * alpha[1])]
    }
}

/// Newton's step from x, which is outside of the set, along the tangents of the offset surface;
/// none where the body does not face it. `smallest` (per metre) is added to the curvature that is
/// divided by: where both are flat it bounds the step.
#[inline(always)]
pub(super) fn newton<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    x: V3<f64>,
    from: &Offset,
    (plane, bend): (&Plane<f64>, &SurfaceCurvature<f64>),
    smallest: f64,
) -> Option<Move> {
    let of_body = Linearized::new(simd, plane, bend);
    let Linearized { shift, gradient: g, r, w, .. } = of_body;
    let k = from.curvature;
    let (k00, k01, k11) = (w[0] + k[0] + smallest, w[1] + k[1], w[2] + k[2] + smallest);
    let inverse = 1.0 / (k00 * k11 - k01 * k01);
    let mut alpha = [(k11 * r[0] - k01 * r[1]) * inverse, (k00 * r[1] - k01 * r[0]) * inverse];
    if !(g[2] < 0.0 && inverse > 0.0 && inverse.is_finite()) {
        return None;
    }
    let compliance = scaled::<S, f64>([k11, -k01, k00], inverse);
    let frame = &from.frame;
    let mut next = set.offset(simd, moved::<S, f64>(x, of_body.step(alpha), frame));
    if next.feature != from.feature
        && let Some(free) = free_of_features(simd, set, (x, from), &of_body)
    {
        alpha = free;
        next = set.offset(simd, moved::<S, f64>(x, of_body.step(alpha), frame));
    }
    Some(Move { step: of_body.step(alpha), next, shift, compliance })
}

/// Tangential parts of a step from x that leaves the point of the set free; none where B is not
/// positive definite.
#[inline(always)]
fn free_of_features<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    (x, from): (V3<f64>, &Offset),
    of_body: &Linearized,
) -> Option<[f64; 2]> {
    let [t0, t1, n] = from.frame;
    let Linearized { r, w, shift, .. } = *of_body;
    let depth = (from.distance + shift).max(NEAREST * from.distance);
    let (b00, b01, b11) =
        (1.0 + r[0] * r[0] + depth * w[0], r[0] * r[1] + depth * w[1], 1.0 + r[1] * r[1] + depth * w[2]);
    let determinant = b00 * b11 - b01 * b01;
    if !(b00 > 0.0 && determinant > 0.0) {
        return None;
    }
    let inverse = 1.0 / determinant;
    let (e0, e1) = (add_scaled::<S, f64>(t0, -r[0], n), add_scaled::<S, f64>(t1, -r[1], n));
    // The rows of B⁻¹ Eᵀ.
    let row = |a: f64, b: f64| scaled::<S, f64>(add_scaled::<S, f64>(scaled::<S, f64>(e0, a), b, e1), inverse);
    let (f0, f1) = (row(b11, -b01), row(-b01, b00));
    let entry = |i: usize, j: usize| (if i == j { 1.0 } else { 0.0 }) - e0[i] * f0[j] - e1[i] * f1[j];
    let metric = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    let foot = add_scaled::<S, f64>(x, shift, n);
    let y = set.project(simd, x);
    let gradient = apply_symmetric::<S, f64>(&metric, subtract::<S, f64>(y, foot));
    let v = subtract::<S, f64>(foot, set.least(simd, y, gradient, &metric));
    Some([-dot::<S, f64>(f0, v), -dot::<S, f64>(f1, v)])
}

#[cfg(test)]
mod tests {
    use super::{Linearized, NEAREST, free_of_features};
    use crate::measure::solver::exact_shape::{Cuboid, Cylinder, Projectable, Segment};
    use crate::polynomial::Scalar;
    use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};
    use sublevel_testkit::Seeded;

    /// The least sum of what α and the point of the set cost, found by turns: for a point of the
    /// set the best α, for that the nearest point of the set. Walls of cylinders are round, which
    /// a quadratic over the set follows in part.
    #[test]
    fn steps_that_leave_the_point_of_the_set_free_are_those_of_alternating_projections() {
        let half_extents = [0.4, 0.3, 0.2];
        check("box", &Cuboid { half_extents }, half_extents, (1e-6, 0.9));
        check("cylinder", &Cylinder { radius: 0.3, half_height: 0.2 }, [0.3, 0.3, 0.2], (2e-2, 0.9));
        check("segment", &Segment { half_length: 0.4 }, [0.0, 0.0, 0.4], (1e-6, 0.999));
    }

    fn check<P: Projectable>(name: &str, set: &P, size: [f64; 3], (more, share): (f64, f64)) {
        let (mut count, mut best, mut worst) = (0, 0, 0.0_f64);
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let x = size.map(|size| (size + 0.3) * random.signed() * 1.2);
            let from = set.offset(Scalar, x);
            if !(from.distance > 1e-3) {
                continue;
            }
            // Bodies from needles to plates, and a point within a tenth of the distance of the
            // surface.
            let mut of_axis = || 10_f64.powf(2.0 * random.signed());
            let curved = [(); 2].map(|()| of_axis());
            let turned = nalgebra::Rotation2::new(3.0 * random.signed());
            let w = turned * Matrix2::from_diagonal(&Vector2::from(curved)) * turned.inverse();
            let r = Vector2::new(random.signed(), random.signed());
            let of_body = Linearized {
                multiplier: 1.0,
                shift: 0.1 * from.distance * random.signed(),
                gradient: [-r.x, -r.y, -1.0],
                r: r.into(),
                w: [w.m11, w.m12, w.m22],
            };
            let alpha = free_of_features(Scalar, set, (x, &from), &of_body).expect("curved");
            let alpha = Vector2::from(alpha);
            let [t0, t1, n] = from.frame.map(Vector3::from);
            let (foot, e) =
                (Vector3::from(x) + of_body.shift * n, Matrix3x2::from_columns(&[t0 - r.x * n, t1 - r.y * n]));
            let depth = (from.distance + of_body.shift).max(NEAREST * from.distance);
            let cost = |alpha: &Vector2<f64>| {
                let at = foot + e * alpha;
                let y = Vector3::from(set.project(Scalar, at.into()));
                (0.5 * (at - y).norm_squared() + 0.5 * depth * alpha.dot(&(w * alpha)), y)
            };
            let inverse = (e.transpose() * e + depth * w).try_inverse().expect("positive definite");
            // With the momentum of Nesterov (1983).
            let (mut least, mut ahead) = (Vector2::zeros(), Vector2::zeros());
            for k in 0..1000 {
                let (_, y) = cost(&ahead);
                let next = -inverse * (e.transpose() * (foot - y));
                ahead = next + (next - least) * (f64::from(k) / f64::from(k + 3));
                least = next;
            }
            let (at_rest, reached, wanted) = (cost(&Vector2::zeros()).0, cost(&alpha).0, cost(&least).0);
            assert!(reached.is_finite(), "{name}, seed {seed}");
            count += 1;
            if reached <= wanted + more * at_rest {
                best += 1;
            }
            worst = worst.max((reached - wanted) / at_rest);
        }
        println!("{name}: {best} of {count} best, others cost up to {worst:.3} of a step of 0 more");
        assert!(f64::from(best) >= share * f64::from(count), "{name}: {best} of {count}");
        assert!(count > 1000 && worst < 0.6, "{name}: {worst}");
    }
}
