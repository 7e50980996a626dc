//! Newton's method of [`super::newton`] along the tangents of the body.
//!
//! At the solution the tangents of the set's offset surface are those of the body, too. Where the
//! normals still differ, W along the former is large for a thin body, as at its rim, and steps
//! become as short as the body is thick. With n the direction of -∇g, `v = x - P x` where a step
//! leads and `q = W α - r`, the residual is `Tᵀv + (n·v) q`; Newton's method for it starts from
//! `α = 0` and goes on with the features as they are.

use super::newton::Linearized;
use super::projectable::{Offset, Projectable};
use crate::measure::frames::vector::{M3, V3, add, add_scaled, basis, dot, scaled};
use crate::measure::solver::tangent_newton::{FEATURES, Plane, Side, SurfaceCurvature, moved};
use crate::polynomial::{NumberJet, Simd, WithSimd};

/// A step from a point x, as vectorized work: what is inlined where it is seldom needed makes the
/// rest slower.
pub(super) struct AlongBody<'a, P> {
    pub(super) set: &'a P,
    pub(super) side: &'a Side<'a, f64>,
    pub(super) x: V3<f64>,
    /// The body's constraint there, in normalized coordinates.
    pub(super) jet: &'a NumberJet<f64>,
    /// The direction against its gradient, in the frame of the set.
    pub(super) inward: V3<f64>,
    /// Added to the curvature that is divided by, per metre.
    pub(super) smallest: f64,
    /// Longest step, in normalized coordinates relative to the body's size there.
    pub(super) longest: f64,
    /// The share of it that is taken.
    pub(super) share: f64,
}

impl<P: Projectable> WithSimd for AlongBody<'_, P> {
    /// Where it leads, and the set as seen from there.
    type Output = (V3<f64>, Offset);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { set, side, x, jet, inward, smallest, longest, share } = self;
        let frame = basis(simd, inward);
        let local = side.localize(simd, &frame);
        let (plane, bend) = (Plane::new(simd, jet, &local), SurfaceCurvature::new(simd, jet, &local));
        let of_body = Linearized::new(simd, &plane, &bend);
        let (mut alpha, mut feature) = ([0.0; 2], None);
        let mut next = set.offset(simd, moved::<S, f64>(x, of_body.step(alpha), &frame));
        for _ in 0..FEATURES {
            if feature == Some(next.feature) || !(next.distance > 0.0) {
                break;
            }
            let smallest = if feature.is_none() { smallest } else { 0.0 };
            feature = Some(next.feature);
            let Some(better) = corrected(simd, (&of_body, &frame), &next, alpha, smallest) else { break };
            alpha = better;
            next = set.offset(simd, moved::<S, f64>(x, of_body.step(alpha), &frame));
        }
        let step = of_body.step(alpha);
        let length = side.relative_square(simd, &local, step).sqrt();
        let share = share * (longest / length).min(1.0);
        if share == 1.0 {
            return (moved::<S, f64>(x, step, &frame), next);
        }
        let x = moved::<S, f64>(x, scaled::<S, f64>(step, share), &frame);
        (x, set.offset(simd, x))
    }
}

/// α after a step of Newton's method for the residual, with the set as seen from where α has led;
/// none where the body does not face the set there, or where the residual's derivative is not
/// positive. `smallest` (per metre) is added to the curvature that is divided by.
#[inline(always)]
fn corrected<S: Simd>(
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
