//! Newton's step in lanes; derived in [`super::super::newton`], corrections for other features in
//! [`super::super::along_body`].

use super::set::{LaneOffset, LaneSet};
use crate::measure::frames::vector::{V3, add, add_scaled, dot, scaled};
use crate::measure::solver::tangent_newton::{FEATURES, Plane, SurfaceCurvature, moved};
use crate::polynomial::{Simd, Vector};

/// A step and where it leads.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LaneMove<N> {
    /// Along the tangents and the normal where it starts.
    pub(in crate::measure) step: V3<N>,
    /// Where it leads, in the frame of the set.
    pub(in crate::measure) to: V3<N>,
    /// The set as seen from there.
    pub(in crate::measure) next: LaneOffset<N>,
}

/// Newton's steps from points x outside of the set, and the lanes in which the body faces it.
/// `smallest` (per metre) is added to the curvature that is divided by.
#[inline(always)]
pub(in crate::measure) fn newton<S: Simd, N: Vector<S>>(
    simd: S,
    set: &impl LaneSet,
    x: V3<N>,
    from: &LaneOffset<N>,
    (plane, bend): (&Plane<N>, &SurfaceCurvature<N>),
    smallest: f64,
) -> (LaneMove<N>, N::Mask) {
    let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
    let (half, smallest) = (N::splat(simd, 0.5), N::splat(simd, smallest));
    let g = plane.gradient;
    let mean = half.mul_add(plane.value, half).max(N::splat(simd, 0.25));
    let [inverse_slope, inverse_mean] = N::reciprocals(simd, [g[2], mean]);
    let multiplier = -inverse_slope;
    let shift = (plane.value - one) * mean * multiplier;
    let straight = one - shift * g[2] * inverse_mean;
    let r = [
        -(multiplier * shift.mul_add(bend.tilt[0], g[0] * straight)),
        -(multiplier * shift.mul_add(bend.tilt[1], g[1] * straight)),
    ];
    let w = scaled(bend.curvature, multiplier);
    let k = from.curvature;
    let (k00, k01, k11) = (w[0] + k[0] + smallest, w[1] + k[1], w[2] + k[2] + smallest);
    let determinant = k00 * k11 - k01 * k01;
    let inverse = one / determinant;
    let mut alpha = [(k11 * r[0] - k01 * r[1]) * inverse, (k00 * r[1] - k01 * r[0]) * inverse];
    // Numbers with units are compared with 0 alone, so that units change nothing; a determinant of 0
    // gives a step that is no number.
    let facing = N::and(simd, g[2].le(zero), zero.le(determinant));
    let mut to = moved(x, along(alpha, g, multiplier, shift), &from.frame);
    let mut next = set.offset(simd, to);
    let mut seen = *from;
    let mut open = facing;
    let [t0, t1, n] = from.frame;
    for _ in 0..FEATURES {
        open = N::and(simd, open, next.sees_another(simd, &seen));
        if N::bits(simd, open) == 0 {
            break;
        }
        seen = next;
        let m = next.frame[2];
        let height = next.distance * dot(m, n);
        let q = [w[1].mul_add(alpha[1], w[0] * alpha[0]) - r[0], w[2].mul_add(alpha[1], w[1] * alpha[0]) - r[1]];
        let residual =
            [next.distance.mul_add(dot(m, t0), height * q[0]), next.distance.mul_add(dot(m, t1), height * q[1])];
        let (b0, b1) = (bent(&next, t0), bent(&next, t1));
        let (n0, n1) = (dot(b0, n), dot(b1, n));
        let j00 = height.mul_add(w[0], q[0].mul_add(n0, dot(b0, t0)));
        let j01 = height.mul_add(w[1], q[0].mul_add(n1, dot(b1, t0)));
        let j10 = height.mul_add(w[1], q[1].mul_add(n0, dot(b0, t1)));
        let j11 = height.mul_add(w[2], q[1].mul_add(n1, dot(b1, t1)));
        let determinant = j00 * j11 - j01 * j10;
        // Inside the set the height is no number.
        open = N::and(simd, open, N::and(simd, zero.le(height), N::splat(simd, N::TINY).le(determinant)));
        let inverse = one / determinant;
        let change =
            [(j11 * residual[0] - j01 * residual[1]) * inverse, (j00 * residual[1] - j10 * residual[0]) * inverse];
        for i in 0..2 {
            alpha[i] = alpha[i] - change[i].select(open, zero);
        }
        to = moved(x, along(alpha, g, multiplier, shift), &from.frame);
        next = set.offset(simd, to);
    }
    (LaneMove { step: along(alpha, g, multiplier, shift), to, next }, facing)
}

/// A step along the tangents with its part along the normal, where the tangential part of the
/// gradient, of second order, counts as well.
#[inline(always)]
fn along<S: Simd, N: Vector<S>>(alpha: [N; 2], g: V3<N>, multiplier: N, shift: N) -> V3<N> {
    let tangential = g[1].mul_add(alpha[1], g[0] * alpha[0]);
    [alpha[0], alpha[1], multiplier.mul_add(tangential, shift)]
}

/// The derivative of the vector from the set to a point by the point, along t.
#[inline(always)]
fn bent<S: Simd, N: Vector<S>>(seen: &LaneOffset<N>, t: V3<N>) -> V3<N> {
    let [u0, u1, m] = seen.frame;
    let k = seen.curvature;
    let (a, b) = (dot(u0, t) * seen.distance, dot(u1, t) * seen.distance);
    let tangential = add(scaled(u0, k[1].mul_add(b, k[0] * a)), scaled(u1, k[2].mul_add(b, k[1] * a)));
    add_scaled(tangential, dot(m, t), m)
}
