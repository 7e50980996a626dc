//! Proof of sos-convexity: a Gram matrix of the Hessian form.
//!
//! A polynomial is sos-convex when `yᵀ ∇²p(z) y = wᵀ H w` for a positive semidefinite `H` and a basis `w` of monomials
//! `y_i z^e`. A matrix in floating point matches the form only up to a residual; Peyrl and Parrilo (Theoret. Comput.
//! Sci. 409, 2008) show how much positive definiteness pays for it.

use super::Polynomial;
use super::definite::is_positive_definite_above;
use super::monomial::{Exponents, monomials};
use super::rounding::gamma;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Basis element `y_direction · z^exponents` of a Hessian form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct HessianMonomial {
    /// Which component of y: 0, 1 or 2.
    pub direction: u8,
    /// Exponents of z.
    pub exponents: Exponents,
}

/// A Gram matrix of `yᵀ ∇²p(z) y` on a basis of [`HessianMonomial`]s, which may be smaller than the full one.
#[derive(Clone, Debug, PartialEq)]
pub struct HessianGram {
    basis: Vec<HessianMonomial>,
    matrix: DMatrix<f64>,
}

/// What a successful proof leaves: how far the matrix is from needing its definiteness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// Bound δ of the correction that makes the matrix match the polynomial exactly; its smallest eigenvalue is proven
    /// to be larger.
    pub residual: f64,
}

/// Why a certificate proves nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CertificateError {
    /// The basis or matrix is malformed.
    #[error("the certificate is malformed: {0}")]
    Malformed(String),
    /// The Hessian form has a monomial no product of two basis elements gives.
    #[error("the certificate's basis can not express the Hessian term {0}; use a larger basis")]
    BasisTooSmall(String),
    /// The smallest eigenvalue does not exceed the residual.
    #[error(
        "the Gram matrix is not proven positive definite beyond its residual {residual:.3e} \
         (smallest eigenvalue about {smallest_eigenvalue:.3e}); use one farther from singular"
    )]
    NotDefinite {
        /// Bound δ of the correction.
        residual: f64,
        /// Smallest eigenvalue, computed without proof.
        smallest_eigenvalue: f64,
    },
}

/// A monomial `y_i y_j z^e` of a Hessian form, i <= j.
type FormMonomial = (u8, u8, Exponents);

/// Which monomial of the form the product of two basis elements is.
fn product(a: &HessianMonomial, b: &HessianMonomial) -> FormMonomial {
    let exponents = std::array::from_fn(|i| a.exponents[i] + b.exponents[i]);
    (a.direction.min(b.direction), a.direction.max(b.direction), exponents)
}

/// `yᵀ ∇²p(z) y` as integer multiples of coefficients of p: each monomial comes from one term.
fn hessian_form(polynomial: &Polynomial) -> BTreeMap<FormMonomial, (f64, f64)> {
    let mut form = BTreeMap::new();
    for &(exponents, coefficient) in polynomial.terms() {
        for i in 0..3_usize {
            for j in i..3 {
                let factor = if i == j {
                    f64::from(exponents[i]) * (f64::from(exponents[i]) - 1.0)
                } else {
                    2.0 * f64::from(exponents[i]) * f64::from(exponents[j])
                };
                if factor > 0.0 {
                    let mut rest = exponents;
                    rest[i] -= 1;
                    rest[j] -= 1;
                    form.insert((i as u8, j as u8, rest), (coefficient, factor));
                }
            }
        }
    }
    form
}

/// Sum of floating-point numbers and a bound of its error.
#[derive(Default)]
struct BoundedSum {
    sum: f64,
    magnitude: f64,
    terms: usize,
}

impl BoundedSum {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.magnitude += value.abs();
        self.terms += 1;
    }

    /// Upper bound of the magnitude of the exact sum; each addend may itself carry one rounding.
    fn magnitude_bound(&self) -> f64 {
        (self.sum.abs() + gamma(self.terms + 1) * self.magnitude * (1.0 + gamma(self.terms))).next_up()
    }
}

impl HessianGram {
    /// A Gram matrix on a basis.
    ///
    /// # Errors
    /// A basis that is empty, larger than 60, repeated or out of range; a matrix that is not square, symmetric, finite
    /// and of the basis' size.
    pub fn new(basis: Vec<HessianMonomial>, matrix: DMatrix<f64>) -> Result<Self, CertificateError> {
        let malformed = |why: String| Err(CertificateError::Malformed(why));
        let n = basis.len();
        if n == 0 || n > 60 {
            return malformed(format!("its basis has {n} elements; 1 to 60 are possible"));
        }
        if let Some(bad) = basis.iter().find(|b| b.direction > 2 || b.exponents.iter().any(|&e| e > 3)) {
            return malformed(format!("basis element {bad:?} is out of range (direction 0..2, exponents up to 3)"));
        }
        let mut sorted = basis.clone();
        sorted.sort_unstable();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            return malformed("a basis element occurs twice".into());
        }
        if matrix.shape() != (n, n) {
            return malformed(format!(
                "its matrix is {}x{} but its basis has {n} elements",
                matrix.nrows(),
                matrix.ncols()
            ));
        }
        for i in 0..n {
            for j in 0..=i {
                if !matrix[(i, j)].is_finite() || matrix[(i, j)] != matrix[(j, i)] {
                    return malformed(format!("matrix entries ({i}, {j}) and ({j}, {i}) are not finite and equal"));
                }
            }
        }
        Ok(Self { basis, matrix })
    }

    /// All `y_i z^e` with |e| <= degree/2 - 1: 3, 12, 30 or 60 elements.
    pub fn full_basis(degree: usize) -> Vec<HessianMonomial> {
        let of_z = monomials(degree / 2 - 1);
        (0..3)
            .flat_map(|direction| of_z.iter().map(move |&exponents| HessianMonomial { direction, exponents }))
            .collect()
    }

    /// The matrix closest to `matrix` (Frobenius norm) whose form matches the polynomial, up to rounding: the residual of
    /// every monomial is spread evenly over the positions that produce it.
    pub fn nearest(
        polynomial: &Polynomial,
        basis: Vec<HessianMonomial>,
        matrix: DMatrix<f64>,
    ) -> Result<Self, CertificateError> {
        let mut gram = Self::new(basis, matrix)?;
        let n = gram.basis.len();
        let correction: BTreeMap<_, _> = gram
            .residuals(polynomial)
            .into_iter()
            .map(|(key, (sum, count))| (key, sum.sum / count.max(1) as f64))
            .collect();
        for i in 0..n {
            for j in 0..n {
                if let Some(step) = correction.get(&product(&gram.basis[i], &gram.basis[j])) {
                    gram.matrix[(i, j)] += step;
                }
            }
        }
        Ok(gram)
    }

    /// Basis of the certificate.
    pub fn basis(&self) -> &[HessianMonomial] {
        &self.basis
    }

    /// Symmetric Gram matrix, rows and columns in the order of the basis.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// Per monomial β of the form: coefficient of the polynomial's form minus that of `wᵀ H w`, and the number n_β of
    /// ordered matrix positions that produce β.
    fn residuals(&self, polynomial: &Polynomial) -> BTreeMap<FormMonomial, (BoundedSum, usize)> {
        let mut residuals: BTreeMap<FormMonomial, (BoundedSum, usize)> = BTreeMap::new();
        for (key, (coefficient, factor)) in hessian_form(polynomial) {
            residuals.entry(key).or_default().0.add(coefficient * factor);
        }
        for (i, a) in self.basis.iter().enumerate() {
            for (j, b) in self.basis.iter().enumerate() {
                let (sum, count) = residuals.entry(product(a, b)).or_default();
                sum.add(-self.matrix[(i, j)]);
                *count += 1;
            }
        }
        residuals
    }

    /// Proves the polynomial sos-convex from these numbers alone: `λ_min(H) >= δ = √(Σ r_β² / n_β)`, residuals bounded
    /// with their rounding, the eigenvalue by Rump's criterion.
    ///
    /// # Errors
    /// What is missing for a proof, and by how much.
    pub fn prove(&self, polynomial: &Polynomial) -> Result<Margin, CertificateError> {
        let residual = self.residual(polynomial)?;
        if is_positive_definite_above(&self.matrix, residual) {
            Ok(Margin { residual })
        } else {
            let smallest_eigenvalue = self.matrix.symmetric_eigenvalues().min();
            Err(CertificateError::NotDefinite { residual, smallest_eigenvalue })
        }
    }

    /// A proven c >= 0 with `yᵀ ∇²p(z) y >= c |y|²` for all y and z; 0 when there is none or none is found.
    ///
    /// `c |y|²` has the Gram matrix c E with ones where the basis has the plain components of y, so `H - c E` proves c as H
    /// proves 0. The largest c that leaves it positive definite is the smallest eigenvalue of the Schur complement of the rest.
    pub fn curvature_floor(&self, polynomial: &Polynomial) -> f64 {
        let plain: Vec<usize> = (0..self.basis.len()).filter(|&i| self.basis[i].exponents == [0, 0, 0]).collect();
        let rest: Vec<usize> = (0..self.basis.len()).filter(|i| !plain.contains(i)).collect();
        let (Ok(residual), 3) = (self.residual(polynomial), plain.len()) else { return 0.0 };
        let block = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| self.matrix[(rows[i], columns[j])])
        };
        let mut schur = block(&plain, &plain);
        if !rest.is_empty() {
            let Some(cholesky) = block(&rest, &rest).cholesky() else { return 0.0 };
            schur -= block(&plain, &rest) * cholesky.solve(&block(&rest, &plain));
        }
        let estimate = schur.symmetric_eigenvalues().min();
        // What rounding and the residual take decides how close to the estimate a proof gets.
        [0.999, 0.9, 0.5]
            .map(|factor| factor * estimate)
            .into_iter()
            .filter(|&floor| floor > 0.0)
            .find(|&floor| {
                let mut lowered = self.matrix.clone();
                for &i in &plain {
                    lowered[(i, i)] = (lowered[(i, i)] - floor).next_down();
                }
                is_positive_definite_above(&lowered, residual)
            })
            .unwrap_or(0.0)
    }

    /// Bound δ of the correction that makes the matrix match the polynomial exactly.
    fn residual(&self, polynomial: &Polynomial) -> Result<f64, CertificateError> {
        // Above zero: squares of tiny residuals may underflow.
        let mut squares = f64::MIN_POSITIVE;
        for ((i, j, exponents), (sum, count)) in self.residuals(polynomial) {
            let residual = sum.magnitude_bound();
            if count == 0 {
                let [a, b, c] = exponents;
                return Err(CertificateError::BasisTooSmall(format!("y{i} y{j} z^({a}, {b}, {c})")));
            }
            squares += residual * residual / count as f64;
        }
        // Fewer than 2^12 roundings in the sum and root.
        Ok((squares.sqrt() * (1.0 + 1e-12)).next_up())
    }
}
