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

/// Row of the table: the ten distinct entries of `F` for one monomial, padded to a multiple of the vector width.
type Row = [f64; 12];

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
        let mut table = vec![[0.0; 12]; order.len()];
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
                    table[row][slot] = coefficient * factor as f64;
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
        match self.degree {
            2 => evaluate::<2, { count(0) }>(&self.table, z),
            4 => evaluate::<4, { count(2) }>(&self.table, z),
            6 => evaluate::<6, { count(4) }>(&self.table, z),
            _ => evaluate::<8, { count(6) }>(&self.table, z),
        }
    }
}

/// The product of table and monomials with the degree known at compile time, so that every loop unrolls.
fn evaluate<const DEGREE: usize, const K: usize>(table: &[Row], z: &Vector3<f64>) -> Jet {
    let mut powers = [0.0; K];
    fill::<K>(DEGREE - 2, [z.x, z.y, z.z], &mut powers);
    let mut f = [0.0; 12];
    for (row, power) in table.iter().zip(&powers) {
        for (sum, entry) in f.iter_mut().zip(row) {
            *sum += entry * power;
        }
    }
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
