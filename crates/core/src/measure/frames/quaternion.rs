//! Quaternions of [`Number`]s: imaginary parts i, j, k, then the real one, as nalgebra keeps them.

use super::vector::{M3, dot};
use crate::polynomial::{Number, Simd};
use nalgebra::UnitQuaternion;

/// A quaternion, the same in every lane.
#[inline(always)]
pub(in crate::measure) fn splat_quaternion<S: Simd, N: Number<S>>(simd: S, q: &UnitQuaternion<f64>) -> [N; 4] {
    let q = &q.coords;
    [N::splat(simd, q.x), N::splat(simd, q.y), N::splat(simd, q.z), N::splat(simd, q.w)]
}

/// The product of the conjugate of the first with the second.
#[inline(always)]
pub(in crate::measure) fn conjugate_times<S: Simd, N: Number<S>>(a: [N; 4], b: [N; 4]) -> [N; 4] {
    let (u, v) = ([-a[0], -a[1], -a[2]], [b[0], b[1], b[2]]);
    let (u_w, v_w) = (a[3], b[3]);
    let w = u_w * v_w - dot(u, v);
    let i = u_w.mul_add(v[0], v_w * u[0]) + (u[1] * v[2] - u[2] * v[1]);
    let j = u_w.mul_add(v[1], v_w * u[1]) + (u[2] * v[0] - u[0] * v[2]);
    let k = u_w.mul_add(v[2], v_w * u[2]) + (u[0] * v[1] - u[1] * v[0]);
    [i, j, k, w]
}

/// The rotation by a quaternion of length 1, by rows.
#[inline(always)]
pub(in crate::measure) fn rotation_by<S: Simd, N: Number<S>>(simd: S, [i, j, k, w]: [N; 4]) -> M3<N> {
    let (ww, ii, jj, kk) = (w * w, i * i, j * j, k * k);
    let two = N::splat(simd, 2.0);
    let (ij, ik, jk) = (two * i * j, two * i * k, two * j * k);
    let (wi, wj, wk) = (two * w * i, two * w * j, two * w * k);
    [
        [ww + ii - jj - kk, ij - wk, wj + ik],
        [wk + ij, ww - ii + jj - kk, jk - wi],
        [ik - wj, wi + jk, ww - ii - jj + kk],
    ]
}
