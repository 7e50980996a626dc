//! One-pass value, gradient and Hessian from the Hessian of the homogenized polynomial.

use super::jet::{Jet, NumberJet};
use super::monomial::{Exponents, count, degree_of, fill, monomials};
use super::simd::{Scalar, Simd, WithSimd, dispatch};
use super::simd_real::Number;
use nalgebra::{Matrix3, Vector3};

/// Row of the table: the ten distinct entries of `F` for one monomial, padded and aligned to the
/// widest vectors.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Row([f64; 16]);

/// Index pairs (i, j), i <= j, of the ten distinct entries of the symmetric 4x4 matrix `F`, in
/// table order.
const ENTRIES: [(usize, usize); 10] = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 1), (1, 2), (1, 3), (2, 2), (2, 3), (3, 3)];

/// The Hessian `F(z) = ∇²P(1, z)` of the homogenized polynomial `P(z0, z) = z0^k p(z / z0)`, as a
/// table.
///
/// By Euler's identity `∇P = F z̃ / (k - 1)` and `p = z̃ᵀ F z̃ / (k (k - 1))` with `z̃ = (1, z)`,
/// so one product of the table with the monomials of degree at most k - 2 yields value, gradient
/// and Hessian together.
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

    /// Value, gradient and Hessian.
    #[inline]
    pub(super) fn evaluate(&self, z: &Vector3<f64>) -> Jet {
        let task = Evaluation { form: self, z: *z };
        // A quadratic takes less time than the choice of instructions for it.
        if self.degree == 2 { task.with_simd(Scalar) } else { dispatch(task) }
    }

    /// Value and nothing else.
    #[inline]
    pub(super) fn value(&self, z: &Vector3<f64>) -> f64 {
        let [f] = &self.table[..] else { return self.evaluate(z).value };
        let f = &f.0;
        let row = |a: usize, b: usize, c: usize, d: usize| f[a] + f[b] * z.x + f[c] * z.y + f[d] * z.z;
        0.5 * (row(0, 1, 2, 3) + row(1, 4, 5, 6) * z.x + row(2, 5, 7, 8) * z.y + row(3, 6, 8, 9) * z.z)
    }

    /// Value, gradient and Hessian, to be inlined into work for [`dispatch`].
    #[inline(always)]
    pub(super) fn jet<S: Simd>(&self, simd: S, z: [f64; 3]) -> NumberJet<f64> {
        match self.degree {
            2 => jet::<S, 2, { count(0) }>(simd, &self.table, z),
            4 => jet::<S, 4, { count(2) }>(simd, &self.table, z),
            6 => jet::<S, 6, { count(4) }>(simd, &self.table, z),
            _ => jet::<S, 8, { count(6) }>(simd, &self.table, z),
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
        let NumberJet { value, gradient, hessian: h } = self.form.jet(simd, [self.z.x, self.z.y, self.z.z]);
        Jet {
            value,
            gradient: Vector3::from(gradient),
            hessian: Matrix3::new(h[0], h[1], h[2], h[1], h[3], h[4], h[2], h[4], h[5]),
        }
    }
}

/// The product of table and monomials with the degree known at compile time, so that every loop
/// unrolls.
#[inline(always)]
fn jet<S: Simd, const DEGREE: usize, const K: usize>(simd: S, table: &[Row], z: [f64; 3]) -> NumberJet<f64> {
    let mut powers = [1.0; K];
    fill::<K>(DEGREE - 2, z, &mut powers);
    // One check of the length here, none below.
    let table = table.first_chunk::<K>().expect("a table has as many rows as its degree has monomials");
    let f = contract(simd, table, &powers);
    let inverse = 1.0 / (DEGREE - 1) as f64;
    // F z̃, row by row, then z̃ᵀ F z̃.
    let fused = <f64 as Number<S>>::mul_add;
    let mut product = [0.0; 4];
    for (product, [a, b, c, d]) in product.iter_mut().zip([[0, 1, 2, 3], [1, 4, 5, 6], [2, 5, 7, 8], [3, 6, 8, 9]]) {
        *product = fused(f[d], z[2], fused(f[c], z[1], fused(f[b], z[0], f[a])));
    }
    let [g0, g1, g2, g3] = product;
    let product = fused(g3, z[2], fused(g2, z[1], fused(g1, z[0], g0)));
    NumberJet {
        value: product * (1.0 / (DEGREE * (DEGREE - 1)) as f64),
        gradient: [g1 * inverse, g2 * inverse, g3 * inverse],
        hessian: [f[4], f[5], f[6], f[7], f[8], f[9]],
    }
}

/// Sums over the rows k of `table[k][i] powers[k]`, for each of the ten entries i, which lie side
/// by side in vectors.
#[inline(always)]
fn contract<S: Simd, const K: usize>(simd: S, table: &[Row; K], powers: &[f64; K]) -> [f64; ENTRIES.len()] {
    let mut sums = [0.0; ENTRIES.len()];
    if K == 1 {
        // Constant: the only monomial is 1.
        sums.copy_from_slice(&table[0].0[..ENTRIES.len()]);
        return sums;
    }
    // Four sums in turn: a single one would wait for each addition before the next.
    let mut partial = [[simd.splat_f64s(0.0); ENTRIES.len()]; 4];
    let vectors = ENTRIES.len().div_ceil(S::F64_LANES);
    for (rows, powers) in table.chunks(4).zip(powers.chunks(4)) {
        for ((row, &power), sums) in rows.iter().zip(powers).zip(&mut partial) {
            let power = simd.splat_f64s(power);
            for (sum, &entries) in sums.iter_mut().zip(&S::as_simd_f64s(&row.0).0[..vectors]) {
                *sum = simd.mul_add_e_f64s(entries, power, *sum);
            }
        }
    }
    let mut stored = Row([0.0; 16]);
    for (i, target) in S::as_mut_simd_f64s(&mut stored.0).0[..vectors].iter_mut().enumerate() {
        let [a, b, c, d] = [partial[0][i], partial[1][i], partial[2][i], partial[3][i]];
        *target = simd.add_f64s(simd.add_f64s(a, b), simd.add_f64s(c, d));
    }
    sums.copy_from_slice(&stored.0[..ENTRIES.len()]);
    sums
}
