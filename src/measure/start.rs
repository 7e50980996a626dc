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
use super::vector::{V3, apply, dot, normalized, rows, times_transposed};
use crate::body::Body;
use crate::polynomial::{Number, Simd};

/// Turns of the normal.
const TURNS: usize = 2;

/// Least distance that n is turned for, relative to the widths of the ellipsoids.
const LEAST: f64 = 1e-3;

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
        let (of_a, of_b) = (one / wide_a, one / wide_b);
        let mut w = [one; 3];
        for i in 0..3 {
            w[i] = -(relative.origin[i] + of_b.mul_add(v[i], of_a * u[i]));
        }
        let distance = dot(n, w);
        let least = distance.max((wide_a + wide_b) * N::splat(simd, LEAST));
        let (cube_a, cube_b) = (of_a * of_a * of_a, of_b * of_b * of_b);
        let entry = |i: usize, j: usize| {
            let straight = of_a.mul_add(shape_a[i][j], of_b * shape_b[i][j]);
            straight - (cube_a * u[i]).mul_add(u[j], cube_b * v[i] * v[j])
        };
        let matrix = [
            entry(0, 0) + least,
            entry(0, 1),
            entry(0, 2),
            entry(1, 1) + least,
            entry(1, 2),
            entry(2, 2) + least,
        ];
        let mut residual = w;
        for i in 0..3 {
            residual[i] = w[i] - distance * n[i];
        }
        let turn = solve(simd, &matrix, residual);
        n = normalized(simd, [n[0] + turn[0], n[1] + turn[1], n[2] + turn[2]]);
    }
    n
}

/// `M⁻¹ r` of the symmetric matrix with the entries xx, xy, xz, yy, yz, zz, by cofactors.
#[inline(always)]
fn solve<S: Simd, N: Number<S>>(simd: S, [xx, xy, xz, yy, yz, zz]: &[N; 6], r: V3<N>) -> V3<N> {
    let first = [*yy * *zz - *yz * *yz, *xz * *yz - *xy * *zz, *xy * *yz - *xz * *yy];
    let (middle, mixed, last) = (*xx * *zz - *xz * *xz, *xy * *xz - *xx * *yz, *xx * *yy - *xy * *xy);
    let inverse = N::splat(simd, 1.0) / dot([*xx, *xy, *xz], first);
    let product =
        [dot(first, r), dot([first[1], middle, mixed], r), dot([first[2], mixed, last], r)];
    [product[0] * inverse, product[1] * inverse, product[2] * inverse]
}
