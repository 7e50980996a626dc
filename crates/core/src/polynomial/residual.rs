//! What a polynomial form has beyond that of a Gram matrix, monomial by monomial, rounding
//! included.

use super::certificate_error::CertificateError;
use super::rounding::gamma;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Sum of floating-point numbers and a bound of its error.
#[derive(Default)]
struct BoundedSum {
    sum: f64,
    magnitude: f64,
    /// What the addends may be wrong by, besides one rounding each.
    error: f64,
    terms: usize,
}

impl BoundedSum {
    fn add(&mut self, value: f64, error: f64) {
        self.sum += value;
        self.magnitude += value.abs();
        self.error += error;
        self.terms += 1;
    }

    /// Upper bound of the magnitude of the exact sum.
    fn magnitude_bound(&self) -> f64 {
        let errors = self.error * (1.0 + gamma(self.terms));
        (self.sum.abs() + gamma(self.terms + 1) * self.magnitude * (1.0 + gamma(self.terms)) + errors).next_up()
    }
}

/// Per monomial β: its coefficient r_β in the form minus that of the Gram matrix, and the number
/// n_β of ordered positions of the matrix that produce β.
#[derive(Default)]
pub(super) struct Residuals<K>(BTreeMap<K, (BoundedSum, usize)>);

impl<K: Ord + Copy> Residuals<K> {
    /// A term of the form: `value`, computed with one rounding from what is known up to `error`.
    pub(super) fn add(&mut self, key: K, value: f64, error: f64) {
        self.0.entry(key).or_insert_with(|| (BoundedSum::default(), 0)).0.add(value, error);
    }

    /// Subtracts the form of a Gram matrix whose entry (i, j) belongs to the monomial `key(i, j)`.
    pub(super) fn subtract(&mut self, matrix: &DMatrix<f64>, key: impl Fn(usize, usize) -> K) {
        for i in 0..matrix.nrows() {
            for j in 0..matrix.ncols() {
                let (sum, count) = self.0.entry(key(i, j)).or_insert_with(|| (BoundedSum::default(), 0));
                sum.add(-matrix[(i, j)], 0.0);
                *count += 1;
            }
        }
    }

    /// Spreads every residual evenly over the positions of the matrix that produce its monomial:
    /// the nearest matrix (Frobenius norm) that matches the form, up to rounding.
    pub(super) fn close(&self, matrix: &mut DMatrix<f64>, key: impl Fn(usize, usize) -> K) {
        for i in 0..matrix.nrows() {
            for j in 0..matrix.ncols() {
                if let Some((sum, count)) = self.0.get(&key(i, j)) {
                    matrix[(i, j)] += sum.sum / (*count).max(1) as f64;
                }
            }
        }
    }

    /// Bound δ = √(Σ r_β² / n_β) of the correction that makes the matrix match the form exactly.
    ///
    /// # Errors
    /// A monomial of the form that no position produces.
    pub(super) fn norm(&self) -> Result<f64, K> {
        // Above zero: squares of tiny residuals may underflow.
        let mut squares = f64::MIN_POSITIVE;
        for (key, (sum, count)) in &self.0 {
            if *count == 0 {
                return Err(*key);
            }
            let residual = sum.magnitude_bound();
            squares += residual * residual / *count as f64;
        }
        // Fewer than 2^12 roundings in the sum and root.
        Ok((squares.sqrt() * (1.0 + 1e-12)).next_up())
    }
}

/// Checks that a Gram matrix has `n` rows and columns and is finite and symmetric.
pub(super) fn check_matrix(matrix: &DMatrix<f64>, n: usize) -> Result<(), CertificateError> {
    if matrix.shape() != (n, n) {
        let (rows, columns) = matrix.shape();
        return Err(CertificateError::Malformed(format!(
            "its matrix is {rows}x{columns} but its basis has {n} elements"
        )));
    }
    for i in 0..n {
        for j in 0..=i {
            if !matrix[(i, j)].is_finite() || matrix[(i, j)] != matrix[(j, i)] {
                let reason = format!("matrix entries ({i}, {j}) and ({j}, {i}) are not finite and equal");
                return Err(CertificateError::Malformed(reason));
            }
        }
    }
    Ok(())
}
