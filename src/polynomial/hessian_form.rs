//! One-pass value, gradient and Hessian from the Hessian of the homogenized polynomial.

use super::monomial::{Exponents, count, degree_of, fill, monomials};
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

/// Row of the table: the ten distinct entries of `F` for one monomial, padded and aligned to the vector width.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Row([f64; 12]);

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
        let mut table = vec![Row([0.0; 12]); order.len()];
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

    #[inline]
    pub(super) fn evaluate(&self, z: &Vector3<f64>) -> Jet {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
            // SAFETY: the processor has the features this version is compiled for.
            #[allow(unsafe_code)]
            return unsafe { evaluate_avx2(self.degree, &self.table, z) };
        }
        evaluate_degree::<false>(self.degree, &self.table, z)
    }
}

/// The same evaluation, compiled for four doubles at a time and fused multiply-add. Results differ from the plain version
/// within the rounding bound, which counts the roundings of the plain one.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn evaluate_avx2(degree: usize, table: &[Row], z: &Vector3<f64>) -> Jet {
    evaluate_degree::<true>(degree, table, z)
}

#[inline(always)]
fn evaluate_degree<const FUSED: bool>(degree: usize, table: &[Row], z: &Vector3<f64>) -> Jet {
    match degree {
        2 => evaluate::<FUSED, 2, { count(0) }>(table, z),
        4 => evaluate::<FUSED, 4, { count(2) }>(table, z),
        6 => evaluate::<FUSED, 6, { count(4) }>(table, z),
        _ => evaluate::<FUSED, 8, { count(6) }>(table, z),
    }
}

/// The product of table and monomials with the degree known at compile time, so that every loop unrolls.
#[inline(always)]
fn evaluate<const FUSED: bool, const DEGREE: usize, const K: usize>(table: &[Row], z: &Vector3<f64>) -> Jet {
    let mut powers = [0.0; K];
    fill::<K>(DEGREE - 2, [z.x, z.y, z.z], &mut powers);
    // Two sums in turn halve the chain of dependent additions.
    let (mut even, mut odd) = ([0.0; 12], [0.0; 12]);
    let add = |sum: &mut [f64; 12], Row(row): &Row, power: f64| {
        for (sum, entry) in sum.iter_mut().zip(row) {
            *sum = if FUSED { entry.mul_add(power, *sum) } else { *sum + entry * power };
        }
    };
    // One check of the length here, none below.
    let table = &table[..K];
    let mut k = 0;
    while k + 1 < K {
        add(&mut even, &table[k], powers[k]);
        add(&mut odd, &table[k + 1], powers[k + 1]);
        k += 2;
    }
    if k < K {
        add(&mut even, &table[k], powers[k]);
    }
    let f: [f64; 12] = std::array::from_fn(|i| even[i] + odd[i]);
    let inverse = 1.0 / (DEGREE - 1) as f64;
    // F z̃, row by row.
    let g0 = f[0] + f[1] * z.x + f[2] * z.y + f[3] * z.z;
    let g1 = f[1] + f[4] * z.x + f[5] * z.y + f[6] * z.z;
    let g2 = f[2] + f[5] * z.x + f[7] * z.y + f[8] * z.z;
    let g3 = f[3] + f[6] * z.x + f[8] * z.y + f[9] * z.z;
    let value = (g0 + g1 * z.x + g2 * z.y + g3 * z.z) * (inverse / DEGREE as f64);
    Jet {
        value,
        gradient: Vector3::new(g1 * inverse, g2 * inverse, g3 * inverse),
        hessian: Matrix3::new(f[4], f[5], f[6], f[5], f[7], f[8], f[6], f[8], f[9]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_version_agrees_within_rounding() {
        for degree in [2, 4, 6, 8] {
            let terms: Vec<_> =
                monomials(degree).into_iter().enumerate().map(|(i, e)| (e, (i as f64 * 0.7).sin())).collect();
            let form = HessianForm::new(degree, &terms);
            let z = Vector3::new(0.9, -1.1, 0.4);
            let (fast, plain) = (form.evaluate(&z), evaluate_degree::<false>(degree, &form.table, &z));
            let close = |a: f64, b: f64| (a - b).abs() < 1e-13 * (1.0 + a.abs());
            assert!(close(fast.value, plain.value));
            assert!(fast.gradient.iter().zip(&plain.gradient).all(|(a, b)| close(*a, *b)));
            assert!(fast.hessian.iter().zip(&plain.hessian).all(|(a, b)| close(*a, *b)));
        }
    }
}
