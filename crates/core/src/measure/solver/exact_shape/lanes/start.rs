//! Where cold starts begin, in lanes: as in [`super::super::start`], but each turn keeps to one
//! feature of the set.
//!
//! For a unit vector n let x(n) be the point of the body farthest along -n. The nearest point is
//! x(n) for the n with `n(x(n)) = n`, the normal of the set's offset surface there. With U the
//! derivative of -x by n and K that of n(x), Newton's method for it turns n by δ along the
//! tangents, `(I + K U) δ = n(x(n)) - n`. Lanes that this leads into the set or behind it are
//! solved by themselves.

use super::super::start::{ELLIPSOID_TURNS, SMALL_TURN, TABLE_LOOKS};
use super::set::{LaneOffset, LaneSet};
use crate::body::Body;
use crate::measure::frames::vector::{
    V3, add, add_scaled, apply, apply_symmetric, apply_transposed, dot, normalized, rows, scaled, subtract,
    times_transposed,
};
use crate::measure::solver::tangent_newton::Relative;
use crate::polynomial::{Number, Simd, Vector};

/// Points of the body about where it is nearest to the set, from the set's normals n at the body's
/// centre on, and the lanes in which they lie outside of the set and face it.
#[inline(always)]
pub(in crate::measure) fn start<S: Simd, N: Vector<S>>(
    simd: S,
    set: &impl LaneSet,
    body: &Body,
    relative: &Relative<N>,
    mut n: V3<N>,
) -> (V3<N>, N::Mask) {
    let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
    let shape = rows(simd, body.outline().shape());
    let shape = times_transposed(&times_transposed(&relative.rotation, &shape), &relative.rotation);
    let mut open = zero.le(one);
    for _ in 0..ELLIPSOID_TURNS {
        let u = apply(&shape, n);
        let inverse = one / dot(n, u).sqrt();
        let seen = set.offset(simd, add_scaled(relative.origin, -inverse, u));
        let off = subtract(seen.frame[2], n);
        open = N::and(simd, open, is_off(simd, off));
        if N::bits(simd, open) == 0 {
            break;
        }
        let [t0, t1, _] = seen.frame;
        let (s0, s1) = (apply(&shape, t0), apply(&shape, t1));
        let (q0, q1) = (dot(u, t0) * inverse, dot(u, t1) * inverse);
        let bend =
            [(dot(s0, t0) - q0 * q0) * inverse, (dot(s0, t1) - q0 * q1) * inverse, (dot(s1, t1) - q1 * q1) * inverse];
        n = selected(simd, open, turn(simd, n, off, &seen, bend), n);
    }
    open = zero.le(one);
    let mut look = 1;
    loop {
        let own = scaled(apply_transposed(&relative.rotation, n), -one);
        let cell = body.outline().cell(simd, own);
        let point = add(cell.point, apply_symmetric(&cell.turn, own));
        let x = add(relative.origin, apply(&relative.rotation, point));
        let seen = set.offset(simd, x);
        let off = subtract(seen.frame[2], n);
        open = N::and(simd, open, is_off(simd, off));
        if look == TABLE_LOOKS || N::bits(simd, open) == 0 {
            // Tables overshoot flat tips, into the set or beyond.
            return (x, zero.le(dot(seen.frame[2], n)));
        }
        look += 1;
        let [t0, t1, _] = seen.frame;
        let (a0, a1) = (apply_transposed(&relative.rotation, t0), apply_transposed(&relative.rotation, t1));
        let (b0, b1) = (apply_symmetric(&cell.turn, a0), apply_symmetric(&cell.turn, a1));
        n = selected(simd, open, turn(simd, n, off, &seen, [dot(b0, a0), dot(b0, a1), dot(b1, a1)]), n);
    }
}

/// The lanes in which the set is seen along another direction; not those of points inside, whose
/// directions are no numbers.
#[inline(always)]
fn is_off<S: Simd, N: Number<S>>(simd: S, off: V3<N>) -> N::Mask {
    N::splat(simd, SMALL_TURN).le(dot(off, off))
}

/// One vector where the mask is set, else the other.
#[inline(always)]
fn selected<S: Simd, N: Number<S>>(_: S, mask: N::Mask, a: V3<N>, b: V3<N>) -> V3<N> {
    [a[0].select(mask, b[0]), a[1].select(mask, b[1]), a[2].select(mask, b[2])]
}

/// n turned by `(I + K U)⁻¹` of what it is off by, along the tangents of the set.
#[inline(always)]
fn turn<S: Simd, N: Number<S>>(simd: S, n: V3<N>, off: V3<N>, seen: &LaneOffset<N>, u: [N; 3]) -> V3<N> {
    let one = N::splat(simd, 1.0);
    let [t0, t1, _] = seen.frame;
    let k = seen.curvature;
    let (m00, m01) = (k[1].mul_add(u[1], k[0].mul_add(u[0], one)), k[1].mul_add(u[2], k[0] * u[1]));
    let (m10, m11) = (k[2].mul_add(u[1], k[1] * u[0]), k[2].mul_add(u[2], k[1].mul_add(u[1], one)));
    let (d0, d1) = (dot(off, t0), dot(off, t1));
    let inverse = one / (m00 * m11 - m01 * m10);
    let (e0, e1) = ((m11 * d0 - m01 * d1) * inverse, (m00 * d1 - m10 * d0) * inverse);
    normalized(simd, add_scaled(add_scaled(n, e0, t0), e1, t1))
}
