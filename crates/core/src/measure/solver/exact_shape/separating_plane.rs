//! A plane that keeps a body apart from a set with a closed form.

use super::projectable::Projectable;
use crate::measure::frames::vector::{M3, V3, apply, apply_transposed, dot, rows, scaled};
use crate::measure::solver::tangent_newton::{Extrapolated, Relative, Side, TAYLOR_ROUNDING};
use crate::polynomial::Simd;

/// The plane, in the frame of the set, metres.
pub(in crate::measure) struct SeparatingPlane {
    /// By how much it is proven to separate.
    pub(in crate::measure) lower: f64,
    /// Unit normal from the set to the body.
    pub(in crate::measure) n: V3<f64>,
    /// Unit vector against the body's gradient.
    pub(in crate::measure) outward: V3<f64>,
    /// Of the body's constraint.
    pub(in crate::measure) multiplier: f64,
    /// Bound of what rounding of the bodies' places and of sums has left out.
    pub(in crate::measure) rounding: f64,
}

/// The plane across a body's gradient at a point that was stepped to from a frame, made to touch
/// all of the set's feature there. The set is known up to a displacement.
#[inline(always)]
pub(in crate::measure) fn separating_plane<S: Simd, P: Projectable>(
    simd: S,
    (set, displacement): (&P, f64),
    (side, relative): (&Side<'_, f64>, &Relative<f64>),
    at: &Extrapolated<f64>,
    (to, feature): (V3<f64>, u8),
    frame: &M3<f64>,
) -> SeparatingPlane {
    let gradient = apply_transposed::<S, f64>(frame, at.plane.gradient);
    let length = dot::<S, f64>(gradient, gradient).sqrt();
    let multiplier = 1.0 / length;
    let outward = scaled::<S, f64>(gradient, -multiplier);
    let n = set.in_normal_cone(simd, feature, outward);
    let facing = scaled::<S, f64>(apply::<S, f64>(frame, n), -1.0);
    let own = scaled::<S, f64>(apply_transposed::<S, f64>(&relative.rotation, n), -1.0);
    let inverse: M3<f64> = rows(simd, side.body().inverse());
    let deficit = side.support_deficit(simd, at, facing, apply_transposed::<S, f64>(&inverse, own));
    let size = to[0].abs() + to[1].abs() + to[2].abs() + set.reach();
    let rounding = TAYLOR_ROUNDING * size + (displacement + side.displacement) * (1.0 + TAYLOR_ROUNDING);
    let charged = deficit + TAYLOR_ROUNDING * (deficit.abs() + multiplier);
    let lower = set.separation(simd, n, (to, charged)) - rounding;
    SeparatingPlane { lower, n, outward, multiplier, rounding }
}
