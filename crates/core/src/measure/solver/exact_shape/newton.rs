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
//! with the straightened constraint of [`super::super::tangent_newton::newton`]. Where the step
//! leads to another feature of the set, K is that of the wrong one. No evaluation of g is needed to
//! find that out: with `v = x - P x` at the point that was stepped to and `q = W α - r`, the
//! residual is `Tᵀv + (n·v) q`, and Newton's method for that goes on with the features as they are.

use super::projectable::{Offset, Projectable};
use crate::measure::frames::vector::{M3, V3, add, add_scaled, dot, scaled};
use crate::measure::solver::tangent_newton::{FEATURES, Plane, SurfaceCurvature, Symmetric2, moved};
use crate::polynomial::Simd;

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
    r: [f64; 2],
    w: Symmetric2<f64>,
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
    let mut feature = from.feature;
    for _ in 0..FEATURES {
        if next.feature == feature || !(next.distance > 0.0) {
            break;
        }
        feature = next.feature;
        let Some(better) = corrected(simd, (&of_body, frame), &next, alpha, 0.0) else { break };
        alpha = better;
        next = set.offset(simd, moved::<S, f64>(x, of_body.step(alpha), frame));
    }
    Some(Move { step: of_body.step(alpha), next, shift, compliance })
}

/// Tangential parts of a step after one of Newton's for the residual with the set as seen from
/// where it leads; none where the body does not face the set there.
#[inline(always)]
pub(super) fn corrected<S: Simd>(
    _: S,
    (of_body, &[t0, t1, n]): (&Linearized, &M3<f64>),
    next: &Offset,
    alpha: [f64; 2],
    smallest: f64,
) -> Option<[f64; 2]> {
    let Linearized { r, w, .. } = of_body;
    let [u0, u1, m] = next.frame;
    let along = next.distance * dot::<S, f64>(m, n);
    if !(along > 0.0) {
        return None;
    }
    let q = [w[0] * alpha[0] + w[1] * alpha[1] - r[0], w[1] * alpha[0] + w[2] * alpha[1] - r[1]];
    let residual =
        [next.distance * dot::<S, f64>(m, t0) + along * q[0], next.distance * dot::<S, f64>(m, t1) + along * q[1]];
    // The derivative of v along a tangent.
    let bent = |t: V3<f64>| {
        let (a, b) = (dot::<S, f64>(u0, t) * next.distance, dot::<S, f64>(u1, t) * next.distance);
        let k = next.curvature;
        let tangential =
            add::<S, f64>(scaled::<S, f64>(u0, k[0] * a + k[1] * b), scaled::<S, f64>(u1, k[1] * a + k[2] * b));
        add_scaled::<S, f64>(tangential, dot::<S, f64>(m, t), m)
    };
    let (b0, b1) = (bent(t0), bent(t1));
    let (n0, n1) = (dot::<S, f64>(b0, n), dot::<S, f64>(b1, n));
    let least = along * smallest;
    let (j00, j01) =
        (dot::<S, f64>(b0, t0) + along * w[0] + q[0] * n0, dot::<S, f64>(b1, t0) + along * w[1] + q[0] * n1);
    let (j10, j11) =
        (dot::<S, f64>(b0, t1) + along * w[1] + q[1] * n0, dot::<S, f64>(b1, t1) + along * w[2] + q[1] * n1);
    let j = [[j00 + least, j01], [j10, j11 + least]];
    let determinant = j[0][0] * j[1][1] - j[0][1] * j[1][0];
    if !(determinant > 0.0) {
        return None;
    }
    let inverse = 1.0 / determinant;
    let (of_0, of_1) = (j[1][1] * residual[0] - j[0][1] * residual[1], j[0][0] * residual[1] - j[1][0] * residual[0]);
    Some([alpha[0] - of_0 * inverse, alpha[1] - of_1 * inverse])
}
