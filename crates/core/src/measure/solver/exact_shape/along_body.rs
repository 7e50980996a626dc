//! Newton's method of [`super::newton`] along the tangents of the body.
//!
//! At the solution the tangents of the set's offset surface are those of the body, too. Where the
//! normals still differ, W along the former is large for a thin body, as at its rim, and steps
//! become as short as the body is thick. With n the direction of -∇g the residual `Tᵀv + (n·v) q`
//! is the same, and the step starts from `α = 0`.

use super::newton::{Linearized, corrected};
use super::projectable::{Offset, Projectable};
use crate::measure::frames::vector::{V3, basis, scaled};
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
