//! One-pass value, gradient and Hessian from the Hessian of the homogenized polynomial.

use super::monomial::{Exponents, count, degree_of, fill, monomials};
use super::simd::{Number, Simd, WithSimd, dispatch};
use nalgebra::{Matrix3, Vector3};

/// Value, gradient and Hessian of a function of three variables at one point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet {
    /// Value.
    pub value: f64,
    /// Gradient.
    pub gradient: Vector3<f64>,
    /// Symmetric Hessian.
    pub hessian: Matrix3<f64>,
}

/// Value, gradient and Hessian (xx, xy, xz, yy, yz, zz) in every lane.
#[derive(Clone, Copy, Debug)]
pub struct NumberJet<N> {
    /// Value.
    pub value: N,
    /// Gradient.
    pub gradient: [N; 3],
    /// Distinct entries of the symmetric Hessian: xx, xy, xz, yy, yz, zz.
    pub hessian: [N; 6],
}

impl From<Jet> for NumberJet<f64> {
    fn from(Jet { value, gradient, hessian: h }: Jet) -> Self {
        Self { value, gradient: gradient.into(), hessian: [h.m11, h.m12, h.m13, h.m22, h.m23, h.m33] }
    }
}

/// Row of the table: the ten distinct entries of `F` for one monomial, padded and aligned to the widest vectors.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Row(pub(super) [f64; 16]);

/// Index pairs (i, j), i <= j, of the ten distinct entries of the symmetric 4x4 matrix `F`, in table order.
const ENTRIES: [(usize, usize); 10] = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];

/// The Hessian `F(z) = ∇²P(1, z)` of the homogenized polynomial `P(z0, z) = z0^k p(z / z0)`, as a table.
///
/// By Euler's identity `∇P = F z̃ / (k - 1)` and `p = z̃ᵀ F z̃ / (k (k - 1))` with `z̃ = (1, z)`, so one product of the
/// table with the monomials of degree at most k - 2 yields value, gradient and Hessian together.
#[derive(Clone, Debug)]
pub(super) struct HessianForm {
    degree: usize,
    table: Vec<Row>,
}

impl HessianForm {
    /// Table of the polynomial with these terms, of even degree `degree` in 2..=8.
    pub(super) fn new(degree: usize, terms: &[(Exponents, f64)]) -> Self {
        let order = monomials(degree - 2);
        let mut table = vec![Row([0.0; 16]); order.len()];
        for &(exponents, coefficient) in terms {
            let z0 = degree - degree_of(exponents);
            let homogeneous = [z0, usize::from(exponents[0]), usize::from(exponents[1]), usize::from(exponents[2])];
            for (slot, &(i, j)) in ENTRIES.iter().enumerate() {
                let factor = if i == j {
                    homogeneous[i] * homogeneous[i].saturating_sub(1)
                } else {
                    homogeneous[i] * homogeneous[j]
                };
                if factor == 0 {
                    continue;
                }
                let mut rest = homogeneous;
                rest[i] -= 1;
                rest[j] -= 1;
                let rest = [rest[1] as u8, rest[2] as u8, rest[3] as u8];
                if let Some(row) = order.iter().position(|&monomial| monomial == rest) {
                    // One rounding: distinct terms of p reach distinct (slot, row).
                    table[row].0[slot] = coefficient * factor as f64;
                }
            }
        }
        Self { degree, table }
    }

    pub(super) fn degree(&self) -> usize {
        self.degree
    }

    /// Value, gradient and Hessian with the widest arithmetic there is.
    #[inline]
    pub(super) fn evaluate(&self, z: &Vector3<f64>) -> Jet {
        dispatch(Evaluation { form: self, z: *z })
    }

    /// Value, gradient and Hessian, to be inlined into work for [`dispatch`].
    #[inline(always)]
    pub(super) fn jet<S: Simd, N: Number<S>>(&self, simd: S, z: [N; 3]) -> NumberJet<N> {
        match self.degree {
            2 => jet::<S, N, 2, { count(0) }>(simd, &self.table, z),
            4 => jet::<S, N, 4, { count(2) }>(simd, &self.table, z),
            6 => jet::<S, N, 6, { count(4) }>(simd, &self.table, z),
            _ => jet::<S, N, 8, { count(6) }>(simd, &self.table, z),
        }
    }
}

/// One evaluation as a task.
struct Evaluation<'a> {
    form: &'a HessianForm,
    z: Vector3<f64>,
}

impl WithSimd for Evaluation<'_> {
    type Output = Jet;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Jet {
        let NumberJet { value, gradient, hessian: h } = self.form.jet::<S, f64>(simd, [self.z.x, self.z.y, self.z.z]);
        Jet {
            value,
            gradient: Vector3::from(gradient),
            hessian: Matrix3::new(h[0], h[1], h[2], h[1], h[3], h[4], h[2], h[4], h[5]),
        }
    }
}

/// The product of table and monomials with the degree known at compile time, so that every loop unrolls.
#[inline(always)]
fn jet<S: Simd, N: Number<S>, const DEGREE: usize, const K: usize>(simd: S, table: &[Row], z: [N; 3]) -> NumberJet<N> {
    let mut powers = [N::splat(simd, 1.0); K];
    fill::<S, N, K>(DEGREE - 2, z, &mut powers);
    // One check of the length here, none below.
    let table = table.first_chunk::<K>().expect("a table has as many rows as its degree has monomials");
    let f = N::contract(simd, table, &powers);
    let inverse = N::splat(simd, 1.0 / (DEGREE - 1) as f64);
    // F z̃, row by row, then z̃ᵀ F z̃.
    let mut product = [N::splat(simd, 0.0); 4];
    for (product, [a, b, c, d]) in product.iter_mut().zip([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]]) {
        *product = f[d].mul_add(z[2], f[c].mul_add(z[1], f[b].mul_add(z[0], f[a])));
    }
    let [g0, g1, g2, g3] = product;
    let product = g3.mul_add(z[2], g2.mul_add(z[1], g1.mul_add(z[0], g0)));
    NumberJet {
        value: product * N::splat(simd, 1.0 / (DEGREE * (DEGREE - 1)) as f64),
        gradient: [g1 * inverse, g2 * inverse, g3 * inverse],
        hessian: [f[4], f[5], f[6], f[7], f[8], f[9]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polynomial::simd::{Arch, Lanes};

    fn form(degree: usize) -> HessianForm {
        let terms: Vec<_> =
            monomials(degree).into_iter().enumerate().map(|(i, e)| (e, (i as f64 * 0.7).sin())).collect();
        HessianForm::new(degree, &terms)
    }

    /// Values, second gradient and xz Hessian entries at sixteen points, in lanes or one by one.
    struct Points<'a> {
        form: &'a HessianForm,
        points: [[f64; 16]; 3],
        in_lanes: bool,
    }

    impl WithSimd for Points<'_> {
        type Output = [[f64; 16]; 3];

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let mut found = [[0.0; 16]; 3];
            for start in (0..16).step_by(Lanes::<S>::COUNT) {
                if self.in_lanes {
                    let jet = self.form.jet(simd, self.points.map(|row| Lanes::load(simd, &row[start..])));
                    let entries = [jet.value, jet.gradient[1], jet.hessian[2]];
                    for (entry, row) in entries.into_iter().zip(&mut found) {
                        entry.store(&mut row[start..]);
                    }
                } else {
                    for i in start..start + Lanes::<S>::COUNT {
                        let jet = self.form.jet(simd, self.points.map(|row| row[i]));
                        for (entry, row) in [jet.value, jet.gradient[1], jet.hessian[2]].into_iter().zip(&mut found) {
                            row[i] = entry;
                        }
                    }
                }
            }
            found
        }
    }

    #[test]
    fn every_level_and_every_lane_agrees_within_rounding() {
        for degree in [2, 4, 6, 8] {
            let form = form(degree);
            let points = [0.3, 0.2, -0.1].map(|step| std::array::from_fn(|i| 0.9 - 0.5 * step * i as f64));
            let plain = Arch::Scalar.dispatch(Points { form: &form, points, in_lanes: false });
            for arch in [Arch::Scalar, narrower(), Arch::new()] {
                for in_lanes in [false, true] {
                    let found = arch.dispatch(Points { form: &form, points, in_lanes });
                    for (a, b) in found.iter().flatten().zip(plain.iter().flatten()) {
                        assert!((a - b).abs() < 1e-13 * (1.0 + b.abs()), "degree {degree}, {arch:?}: {a} against {b}");
                    }
                }
            }
        }
    }

    /// One level below the widest, where there is one.
    fn narrower() -> Arch {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            return Arch::V3(simd);
        }
        Arch::Scalar
    }
}
