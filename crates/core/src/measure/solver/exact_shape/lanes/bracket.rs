//! What proves distances, in lanes; derived in [`super::super::distance`].

use super::newton::LaneMove;
use super::set::LaneSet;
use crate::body::Body;
use crate::measure::frames::vector::{M3, V3, apply, apply_transposed, dot, rows, scaled, subtract};
use crate::measure::solver::tangent_newton::{ALIGNED, Extrapolated, Relative, Side, TAYLOR_ROUNDING, moved};
use crate::polynomial::{Number, Simd};

/// Proven brackets, metres, and where they are attained, in the frame of the set.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LaneBracket<N> {
    pub(in crate::measure) lower: N,
    pub(in crate::measure) upper: N,
    /// Point of the body.
    pub(in crate::measure) x: V3<N>,
    /// Point of the set.
    pub(in crate::measure) nearest: V3<N>,
    /// Unit normal from the set to the body.
    pub(in crate::measure) n: V3<N>,
    /// Multiplier of the body's constraint, metres.
    pub(in crate::measure) multiplier: N,
}

/// The brackets at points that were stepped to, with the body's constraint there in the frames of
/// the steps, and the lanes in which they are as narrow as `tolerance` (metres) and the distance is
/// above 0. `displacement` bounds how far the set is from what it stands for, metres.
#[inline(always)]
pub(in crate::measure) fn bracket<S: Simd, N: Number<S>>(
    simd: S,
    (set, displacement): (&impl LaneSet, f64),
    (body, relative, side): (&Body, &Relative<N>, &Side<'_, N>),
    at: &Extrapolated<N>,
    (found, frame): (&LaneMove<N>, &M3<N>),
    tolerance: f64,
) -> (LaneBracket<N>, N::Mask) {
    let one = N::splat(simd, 1.0);
    let taylor = N::splat(simd, TAYLOR_ROUNDING);
    let LaneMove { to, next, .. } = found;
    let gradient = apply_transposed(frame, at.plane.gradient);
    let multiplier = one / dot(gradient, gradient).sqrt();
    let outward = scaled(gradient, -multiplier);
    let n = set.in_normal_cone(simd, next.cone, outward);
    let facing = scaled(apply(frame, n), -one);
    let own = scaled(apply_transposed(&relative.rotation, n), -one);
    let inverse = rows(simd, body.inverse());
    let deficit = side.support_deficit(simd, at, facing, apply_transposed(&inverse, own));
    let size = to[0].abs() + to[1].abs() + to[2].abs() + N::splat(simd, set.reach());
    let displaced = (N::splat(simd, displacement) + side.displacement) * N::splat(simd, 1.0 + TAYLOR_ROUNDING);
    let rounding = taylor.mul_add(size, displaced);
    let charged = taylor.mul_add(deficit.abs() + multiplier, deficit);
    let lower = dot(n, *to) - charged - set.height(simd, n) - rounding;
    let (inward, fine) = side.inward(simd, at);
    let x = moved(*to, inward, frame);
    let nearest = set.project(simd, x);
    let between = subtract(x, nearest);
    let upper = dot(between, between).sqrt() + rounding;
    let off = subtract(outward, next.frame[2]);
    // Across a thin body the gradient turns with the error of its extrapolation.
    let turned = if body.outline().is_thin() { at.gradient_error * multiplier } else { N::splat(simd, 0.0) };
    let is_known = turned.le(N::splat(simd, ALIGNED));
    let is_aligned = N::and(simd, is_known, dot(off, off).le(N::splat(simd, ALIGNED * ALIGNED)));
    let is_narrow = N::and(simd, lower.le(upper), (upper - lower).le(N::splat(simd, tolerance)));
    let is_apart = N::splat(simd, f64::MIN_POSITIVE).le(lower);
    let is_proven = N::and(simd, N::and(simd, fine, is_aligned), N::and(simd, is_narrow, is_apart));
    (LaneBracket { lower, upper, x, nearest, n, multiplier }, is_proven)
}
