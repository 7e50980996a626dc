//! Where to begin when nothing is known but the poses.
//!
//! The distance of two convex sets is the largest value over unit vectors n of `-h_A(-n) - h_B(n)`, h the support functions:
//! `n·w` where w is the difference of the points that are farthest along `-n` and along `n`. Ellipsoids stand for the bodies.
//! Theirs are `h(n) = √(nᵀ Σ n)`, and Newton's method for `w = D n` turns n by
//!
//! ```text
//! (D I + K_A + K_B) dn = w - (n·w) n,    K = (Σ - Σ n nᵀ Σ / h²) / h
//! ```
//!
//! with K the derivative of the farthest point, so that two such turns find about where the bodies face each other. There the
//! outlines of the bodies have marks with all that Newton's method on the bodies themselves needs for its first step.

use super::tangent::Relative;
use super::vector::{V3, add_scaled, apply, dot, normalized, rows, scaled, times_transposed};
use crate::body::Body;
use crate::polynomial::{Number, Simd};

/// Turns of the normal.
const TURNS: usize = 2;

/// Least distance that n is turned for, relative to the widths of the ellipsoids.
const LEAST: f64 = 1e-3;

/// Largest turn, as the largest component of the tangent.
const MOST: f64 = 0.5;

/// The unit vector from B to A across the gap of the ellipsoids that stand for them, in A's frame.
#[inline(always)]
pub(super) fn facing<S: Simd, N: Number<S>>(simd: S, a: &Body, b: &Body, relative: &Relative<N>) -> V3<N> {
    let one = N::splat(simd, 1.0);
    let shape_a = rows(simd, a.outline().shape());
    let shape_b = rows(simd, b.outline().shape());
    let shape_b = times_transposed(&times_transposed(&relative.rotation, &shape_b), &relative.rotation);
    let mut n = normalized(simd, [-relative.origin[0], -relative.origin[1], -relative.origin[2]]);
    for _ in 0..TURNS {
        let (u, v) = (apply(&shape_a, n), apply(&shape_b, n));
        let (wide_a, wide_b) = (dot(n, u).sqrt(), dot(n, v).sqrt());
        let inverse = one / (wide_a * wide_b);
        let (of_a, of_b) = (inverse * wide_b, inverse * wide_a);
        let mut w = [one; 3];
        for i in 0..3 {
            w[i] = -(relative.origin[i] + of_b.mul_add(v[i], of_a * u[i]));
        }
        let distance = dot(n, w);
        let least = distance.max((wide_a + wide_b) * N::splat(simd, LEAST));
        let (scaled_a, scaled_b) = (scaled(u, of_a * of_a * of_a), scaled(v, of_b * of_b * of_b));
        let mut matrix = [least; 6];
        for (entry, (i, j)) in matrix.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
            let straight = of_a.mul_add(shape_a[i][j], of_b * shape_b[i][j]);
            let bent = scaled_a[i].mul_add(u[j], scaled_b[i] * v[j]);
            *entry = if i == j { least + straight - bent } else { straight - bent };
        }
        let mut residual = w;
        for i in 0..3 {
            residual[i] = w[i] - distance * n[i];
        }
        n = turned(simd, n, &matrix, residual);
    }
    n
}

/// The direction of `n + M⁻¹ r`, by cofactors of the symmetric matrix M with the entries xx, xy, xz, yy, yz, zz; the turn is
/// limited.
#[inline(always)]
fn turned<S: Simd, N: Number<S>>(simd: S, n: V3<N>, [xx, xy, xz, yy, yz, zz]: &[N; 6], r: V3<N>) -> V3<N> {
    let first = [*yy * *zz - *yz * *yz, *xz * *yz - *xy * *zz, *xy * *yz - *xz * *yy];
    let (middle, mixed, last) = (*xx * *zz - *xz * *xz, *xy * *xz - *xx * *yz, *xx * *yy - *xy * *xy);
    let determinant = dot([*xx, *xy, *xz], first);
    let turn = [dot(first, r), dot([first[1], middle, mixed], r), dot([first[2], mixed, last], r)];
    let longest = turn[0].abs().max(turn[1].abs()).max(turn[2].abs());
    let weight = determinant.max(longest * N::splat(simd, 1.0 / MOST));
    normalized(simd, add_scaled(turn, weight, n))
}
