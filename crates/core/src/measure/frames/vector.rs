//! Small vectors and matrices of [`Number`]s, which nalgebra's are not: a lane each, inlined into
//! vectorised work.

use crate::polynomial::{Number, Simd};
use nalgebra::Matrix3;

/// Three numbers.
pub(in crate::measure) type V3<N> = [N; 3];

/// A 3x3 matrix, by rows.
pub(in crate::measure) type M3<N> = [[N; 3]; 3];

/// `a·b`.
#[inline(always)]
pub(in crate::measure) fn dot<S: Simd, N: Number<S>>(a: V3<N>, b: V3<N>) -> N {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// `a + s b`.
#[inline(always)]
pub(in crate::measure) fn add_scaled<S: Simd, N: Number<S>>(a: V3<N>, s: N, b: V3<N>) -> V3<N> {
    [s.mul_add(b[0], a[0]), s.mul_add(b[1], a[1]), s.mul_add(b[2], a[2])]
}

/// `s v`.
#[inline(always)]
pub(in crate::measure) fn scaled<S: Simd, N: Number<S>>(v: V3<N>, s: N) -> V3<N> {
    [v[0] * s, v[1] * s, v[2] * s]
}

/// `a + b`.
#[inline(always)]
pub(in crate::measure) fn add<S: Simd, N: Number<S>>(a: V3<N>, b: V3<N>) -> V3<N> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `a - b`.
#[inline(always)]
pub(in crate::measure) fn subtract<S: Simd, N: Number<S>>(a: V3<N>, b: V3<N>) -> V3<N> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `M v`.
#[inline(always)]
pub(in crate::measure) fn apply<S: Simd, N: Number<S>>(m: &M3<N>, v: V3<N>) -> V3<N> {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// `Mᵀ v`.
#[inline(always)]
pub(in crate::measure) fn apply_transposed<S: Simd, N: Number<S>>(m: &M3<N>, v: V3<N>) -> V3<N> {
    let mut result = [m[0][0] * v[0], m[0][1] * v[0], m[0][2] * v[0]];
    for (row, factor) in m[1..].iter().zip(&v[1..]) {
        result = add_scaled(result, *factor, *row);
    }
    result
}

/// The vector of length 1 along v.
#[inline(always)]
pub(in crate::measure) fn normalized<S: Simd, N: Number<S>>(simd: S, v: V3<N>) -> V3<N> {
    let inverse = N::splat(simd, 1.0) / dot(v, v).sqrt();
    [v[0] * inverse, v[1] * inverse, v[2] * inverse]
}

/// The matrix by rows, the same in every lane.
#[inline(always)]
pub(in crate::measure) fn rows<S: Simd, N: Number<S>>(simd: S, m: &Matrix3<f64>) -> M3<N> {
    let mut rows = [[N::splat(simd, 0.0); 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            rows[i][j] = N::splat(simd, m[(i, j)]);
        }
    }
    rows
}

/// `M Nᵀ`.
#[inline(always)]
pub(in crate::measure) fn times_transposed<S: Simd, N: Number<S>>(m: &M3<N>, n: &M3<N>) -> M3<N> {
    [apply(n, m[0]), apply(n, m[1]), apply(n, m[2])]
}

/// `R M Rᵀ` of a symmetric matrix with the entries xx, xy, xz, yy, yz, zz.
#[inline(always)]
pub(in crate::measure) fn turned_symmetric<S: Simd, N: Number<S>>(rotation: &M3<N>, m: &[N; 6]) -> [N; 6] {
    let [r0, r1, r2] = *rotation;
    let (m0, m1, m2) = (apply_symmetric(m, r0), apply_symmetric(m, r1), apply_symmetric(m, r2));
    [dot(r0, m0), dot(r0, m1), dot(r0, m2), dot(r1, m1), dot(r1, m2), dot(r2, m2)]
}

/// `H v` of the symmetric matrix with the entries xx, xy, xz, yy, yz, zz.
#[inline(always)]
pub(in crate::measure) fn apply_symmetric<S: Simd, N: Number<S>>(h: &[N; 6], v: V3<N>) -> V3<N> {
    [dot([h[0], h[1], h[2]], v), dot([h[1], h[3], h[4]], v), dot([h[2], h[4], h[5]], v)]
}

/// The cofactors of the symmetric matrix with the entries xx, xy, xz, yy, yz, zz, which are its
/// determinant times its inverse, and the determinant.
#[inline(always)]
pub(in crate::measure) fn cofactors<S: Simd, N: Number<S>>(_: S, [xx, xy, xz, yy, yz, zz]: [N; 6]) -> ([N; 6], N) {
    let cofactors = [
        yy * zz - yz * yz,
        xz * yz - xy * zz,
        xy * yz - xz * yy,
        xx * zz - xz * xz,
        xy * xz - xx * yz,
        xx * yy - xy * xy,
    ];
    (cofactors, dot([xx, xy, xz], [cofactors[0], cofactors[1], cofactors[2]]))
}

/// A right-handed orthonormal basis whose third vector is the direction of `v` (Duff et al.,
/// Building an orthonormal basis, revisited, JCGT 6, 2017).
#[inline(always)]
pub(in crate::measure) fn basis<S: Simd, N: Number<S>>(simd: S, v: V3<N>) -> M3<N> {
    let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
    let sign = one.select(zero.le(v[2]), -one);
    let square = dot(v, v);
    let length = square.sqrt();
    // With n = v / length, a = -1 / (sign + n_2): one division for both.
    let reach = sign.mul_add(length, v[2]);
    let inverse = one / (length * reach);
    let n = scaled(v, reach * inverse);
    let a = -square * inverse;
    let b = n[0] * n[1] * a;
    let first = [(sign * n[0] * n[0]).mul_add(a, one), sign * b, -sign * n[0]];
    let second = [b, (n[1] * n[1]).mul_add(a, sign), -n[1]];
    [first, second, n]
}

#[cfg(test)]
mod tests {
    use super::basis;
    use crate::polynomial::Scalar;
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    #[test]
    fn bases_are_orthonormal_right_handed_and_along_their_vector() {
        let mut random = Seeded(1);
        for i in 0..10_000 {
            // Also close to the poles, and of any length.
            let near = 10_f64.powi(-(i % 20));
            let pole = if i % 3 == 0 { 1.0 } else { -1.0 };
            let v = Vector3::new(near * random.signed(), near * random.signed(), pole) * 10_f64.powi(i % 13 - 6);
            let m = Matrix3::from(basis::<_, f64>(Scalar, v.into())).transpose();
            assert!((m * m.transpose() - Matrix3::identity()).amax() < 8.0 * f64::EPSILON, "{v:?}");
            assert!((m.determinant() - 1.0).abs() < 1e-14, "{v:?}");
            assert!((m.row(2).transpose() - v.normalize()).amax() < 4.0 * f64::EPSILON, "{v:?}");
        }
    }
}
