//! Where a cold start begins: about where a body is nearest to a set with a closed form.
//!
//! For a unit vector n let x(n) be the point of the body farthest along -n. The nearest point is
//! x(n) for the n with `n(x(n)) = n`, the normal of the set's offset surface there. With U the
//! derivative of -x by n and K that of n(x), Newton's method for it turns n by δ along the
//! tangents, `(I + K U) δ = n(x(n)) - n`: on the ellipsoid that stands for the body first, then on
//! its support table.
//!
//! Of a thin body x(n) crosses the whole side while n turns by no more than the thickness, so that
//! such turns overshoot. There the point of the ellipsoid is looked for and not its normal: with
//! `x = c + A z`, |z| = 1, `v = x - P x` and J the derivative of v, Newton's method on the sphere
//! for the least `|v|² / 2` has the step s across z with
//!
//! ```text
//! (AᵀJA + μ I) s = -Aᵀv + ν z,    μ = -z·Aᵀv,
//! ```
//!
//! which starts where the way from the centre to the set leaves the ellipsoid: μ is above 0 there.

use super::projectable::{Offset, Projectable};
use crate::body::Body;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, normalized, rows, scaled,
    subtract, times_transposed,
};
use crate::measure::solver::tangent_newton::Relative;
use crate::polynomial::Simd;

/// Most turns of the normal, or of a thin body steps of the point, on the ellipsoid.
pub(in crate::measure) const ELLIPSOID_TURNS: usize = 6;

/// Most looks at the support table.
pub(super) const TABLE_LOOKS: usize = 3;

/// Square of a turn of the normal, radians squared, or of such a step in normalized coordinates,
/// that is left to Newton's method on the body itself.
///
/// Larger, it starts too far away; smaller, support tables are read once more than needed. It
/// changes time only; no test pins it.
pub(super) const SMALL_TURN: f64 = 1e-2;

/// A point of the body and the direction against which it is about the farthest one; from the
/// set's normal n at the body's centre on, by at most so many turns on the ellipsoid: none where n
/// is known to be about the normal that they end with.
#[inline(always)]
pub(in crate::measure) fn start<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    body: &Body,
    relative: &Relative<f64>,
    mut n: V3<f64>,
    turns: usize,
) -> (V3<f64>, V3<f64>) {
    if body.outline().is_thin() {
        let n = on_the_ellipsoid(simd, set, body, relative, n, turns);
        return on_the_table(simd, set, body, relative, n);
    }
    let shape: M3<f64> = rows(simd, body.outline().shape());
    let turned = times_transposed::<S, f64>(&relative.rotation, &shape);
    let shape = times_transposed::<S, f64>(&turned, &relative.rotation);
    for _ in 0..turns {
        let u = apply::<S, f64>(&shape, n);
        let inverse = 1.0 / dot::<S, f64>(n, u).sqrt();
        let seen = set.offset(simd, add_scaled::<S, f64>(relative.origin, -inverse, u));
        let off = subtract::<S, f64>(seen.frame[2], n);
        if !(seen.distance > 0.0) || dot::<S, f64>(off, off) < SMALL_TURN {
            break;
        }
        let [t0, t1, _] = seen.frame;
        let (s0, s1) = (apply::<S, f64>(&shape, t0), apply::<S, f64>(&shape, t1));
        let (q0, q1) = (dot::<S, f64>(u, t0) * inverse, dot::<S, f64>(u, t1) * inverse);
        let bend = [
            (dot::<S, f64>(s0, t0) - q0 * q0) * inverse,
            (dot::<S, f64>(s0, t1) - q0 * q1) * inverse,
            (dot::<S, f64>(s1, t1) - q1 * q1) * inverse,
        ];
        n = turn(simd, n, off, &seen, bend);
    }
    on_the_table(simd, set, body, relative, n)
}

/// The same on the support table, from a direction on; of a thin body the nearest point that was
/// seen.
#[inline(always)]
fn on_the_table<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    body: &Body,
    relative: &Relative<f64>,
    mut n: V3<f64>,
) -> (V3<f64>, V3<f64>) {
    let (mut best, mut nearest) = (None, f64::INFINITY);
    for look in 1.. {
        let (x, bend) = farthest(simd, body, relative, n);
        let seen = set.offset(simd, x);
        if let Some(start) = best
            && !(0.0 < seen.distance && seen.distance < nearest)
        {
            return start;
        }
        let off = subtract::<S, f64>(seen.frame[2], n);
        if look == TABLE_LOOKS || !(seen.distance > 0.0) || dot::<S, f64>(off, off) < SMALL_TURN {
            return (x, n);
        }
        if body.outline().is_thin() {
            (best, nearest) = (Some((x, n)), seen.distance);
        }
        let [t0, t1, _] = seen.frame;
        let (a0, a1) =
            (apply_transposed::<S, f64>(&relative.rotation, t0), apply_transposed::<S, f64>(&relative.rotation, t1));
        let (b0, b1) = (apply_symmetric::<S, f64>(&bend, a0), apply_symmetric::<S, f64>(&bend, a1));
        n = turn(simd, n, off, &seen, [dot::<S, f64>(b0, a0), dot::<S, f64>(b0, a1), dot::<S, f64>(b1, a1)]);
    }
    unreachable!("the last look returns")
}

/// The inward normal where the ellipsoid that stands for a thin body is nearest to the set, from
/// the set's normal n at the body's centre on.
#[inline(always)]
fn on_the_ellipsoid<S: Simd, P: Projectable>(
    simd: S,
    set: &P,
    body: &Body,
    relative: &Relative<f64>,
    n: V3<f64>,
    turns: usize,
) -> V3<f64> {
    let linear: M3<f64> = rows(simd, &body.normalization().linear);
    let inverse: M3<f64> = rows(simd, body.inverse());
    let radius = body.outline().radius();
    let mut z = normalized(simd, apply::<S, f64>(&linear, apply_transposed::<S, f64>(&relative.rotation, n)));
    z = scaled::<S, f64>(z, -1.0);
    for _ in 0..turns {
        let out = scaled::<S, f64>(apply::<S, f64>(&inverse, z), radius);
        let out = apply::<S, f64>(&relative.rotation, out);
        let seen = set.offset(simd, add::<S, f64>(relative.origin, out));
        if !(seen.distance > 0.0) {
            break;
        }
        // The set's tangents and normal in normalized coordinates.
        let [t0, t1, m] = seen.frame.map(|t| {
            let own = apply_transposed::<S, f64>(&relative.rotation, t);
            scaled::<S, f64>(apply_transposed::<S, f64>(&inverse, own), radius)
        });
        // Where the ellipsoid reaches through the set there is no nearest point.
        let pull = -dot::<S, f64>(z, m);
        if !(pull > 0.0) {
            break;
        }
        let [k00, k01, k11] = seen.curvature;
        let (b0, b1) = (
            add_scaled::<S, f64>(scaled::<S, f64>(t0, k00), k01, t1),
            add_scaled::<S, f64>(scaled::<S, f64>(t1, k11), k01, t0),
        );
        // Everything over the distance.
        let entry = |i: usize, j: usize| b0[i] * t0[j] + b1[i] * t1[j] + m[i] * m[j] / seen.distance;
        let hessian =
            [entry(0, 0) + pull, entry(0, 1), entry(0, 2), entry(1, 1) + pull, entry(1, 2), entry(2, 2) + pull];
        let (cofactors, determinant) = cofactors(simd, hessian);
        let (of_m, of_z) = (apply_symmetric::<S, f64>(&cofactors, m), apply_symmetric::<S, f64>(&cofactors, z));
        let across = dot::<S, f64>(z, of_m) / dot::<S, f64>(z, of_z);
        let step = scaled::<S, f64>(add_scaled::<S, f64>(of_m, -across, of_z), -1.0 / determinant);
        let square = dot::<S, f64>(step, step);
        if !square.is_finite() {
            break;
        }
        z = normalized(simd, add::<S, f64>(z, step));
        if square < SMALL_TURN {
            break;
        }
    }
    let outward = apply::<S, f64>(&relative.rotation, apply_transposed::<S, f64>(&linear, z));
    scaled::<S, f64>(normalized(simd, outward), -1.0)
}

/// About the point of the body farthest along -n, and its derivative by that direction in the
/// body's frame.
#[inline(always)]
fn farthest<S: Simd>(simd: S, body: &Body, relative: &Relative<f64>, n: V3<f64>) -> (V3<f64>, [f64; 6]) {
    let own = scaled::<S, f64>(apply_transposed::<S, f64>(&relative.rotation, n), -1.0);
    let cell = body.outline().cell::<S, f64>(simd, own);
    let point = apply::<S, f64>(&relative.rotation, cell.farthest(simd, own));
    (add::<S, f64>(relative.origin, point), cell.turn)
}

/// n turned by `(I + K U)⁻¹` of what it is off by, along the tangents of the set.
#[inline(always)]
fn turn<S: Simd>(simd: S, n: V3<f64>, off: V3<f64>, seen: &Offset, u: [f64; 3]) -> V3<f64> {
    let [t0, t1, _] = seen.frame;
    let k = seen.curvature;
    let (m00, m01) = (1.0 + k[0] * u[0] + k[1] * u[1], k[0] * u[1] + k[1] * u[2]);
    let (m10, m11) = (k[1] * u[0] + k[2] * u[1], 1.0 + k[1] * u[1] + k[2] * u[2]);
    let (d0, d1) = (dot::<S, f64>(off, t0), dot::<S, f64>(off, t1));
    let inverse = 1.0 / (m00 * m11 - m01 * m10);
    let (e0, e1) = ((m11 * d0 - m01 * d1) * inverse, (m00 * d1 - m10 * d0) * inverse);
    normalized(simd, add_scaled::<S, f64>(add_scaled::<S, f64>(n, e0, t0), e1, t1))
}
