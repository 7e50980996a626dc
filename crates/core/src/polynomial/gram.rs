//! Proof of sos-convexity: a Gram matrix of the Hessian form.
//!
//! A polynomial is sos-convex when `yᵀ ∇²p(z) y = wᵀ H w` for a positive semidefinite `H` and a
//! basis `w` of monomials `y_i z^e`. A matrix in floating point matches the form only up to a
//! residual; Peyrl and Parrilo (Theoret. Comput. Sci. 409, 2008) show how much positive
//! definiteness absorbs it.

use super::certificate_error::CertificateError;
use super::monomial::{Exponents, monomials};
use super::norm_power::NormPower;
use super::residual::{Residuals, check_matrix};
use super::trivariate::Polynomial;
use super::verified_cholesky::is_positive_definite_above;
use nalgebra::DMatrix;

/// Basis element `y_direction · z^exponents` of a Hessian form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct HessianMonomial {
    /// Which component of y: 0, 1 or 2.
    pub direction: u8,
    /// Exponents of z.
    pub exponents: Exponents,
}

/// A Gram matrix of `yᵀ ∇²p(z) y` on a basis of [`HessianMonomial`]s, which may be smaller than the
/// full one.
#[derive(Clone, Debug, PartialEq)]
pub struct HessianGram {
    basis: Vec<HessianMonomial>,
    matrix: DMatrix<f64>,
}

/// What a successful proof leaves: how far the matrix is from needing its definiteness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margin {
    /// Bound δ of the correction that makes the matrix match the polynomial exactly; its smallest
    /// eigenvalue is proven to be larger.
    pub residual: f64,
}

impl Margin {
    /// Proves all eigenvalues of a Gram matrix above its residual.
    pub(super) fn of(matrix: &DMatrix<f64>, residual: f64) -> Result<Self, CertificateError> {
        if is_positive_definite_above(matrix, residual) {
            return Ok(Self { residual });
        }
        let smallest_eigenvalue = matrix.symmetric_eigenvalues().min();
        Err(CertificateError::NotDefinite { residual, smallest_eigenvalue })
    }
}

/// A monomial `y_i y_j z^e` of a Hessian form, i <= j.
type FormMonomial = (u8, u8, Exponents);

/// Which monomial of the form the product of two basis elements is.
fn product(a: &HessianMonomial, b: &HessianMonomial) -> FormMonomial {
    let exponents = std::array::from_fn(|i| a.exponents[i] + b.exponents[i]);
    (a.direction.min(b.direction), a.direction.max(b.direction), exponents)
}

/// `yᵀ ∇²p(z) y` as integer multiples of coefficients of p: each monomial comes from one term.
fn hessian_form(exponents: Exponents) -> impl Iterator<Item = (FormMonomial, f64)> {
    let pairs = (0..3_usize).flat_map(|i| (i..3).map(move |j| (i, j)));
    pairs.filter_map(move |(i, j)| {
        let factor = if i == j {
            f64::from(exponents[i]) * (f64::from(exponents[i]) - 1.0)
        } else {
            2.0 * f64::from(exponents[i]) * f64::from(exponents[j])
        };
        if factor <= 0.0 {
            return None;
        }
        let mut rest = exponents;
        rest[i] -= 1;
        rest[j] -= 1;
        Some(((i as u8, j as u8, rest), factor))
    })
}

impl HessianGram {
    /// A Gram matrix on a basis.
    ///
    /// # Errors
    /// A basis that is empty, larger than 60, repeated or out of range; a matrix that is not
    /// square, symmetric, finite and of the basis' size.
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
        check_matrix(&matrix, n)?;
        Ok(Self { basis, matrix })
    }

    /// All `y_i z^e` with |e| <= degree/2 - 1: 3, 12, 30 or 60 elements.
    pub fn full_basis(degree: usize) -> Vec<HessianMonomial> {
        let of_z = monomials(degree / 2 - 1);
        (0..3)
            .flat_map(|direction| of_z.iter().map(move |&exponents| HessianMonomial { direction, exponents }))
            .collect()
    }

    /// The matrix closest to `matrix` (Frobenius norm) whose form matches the polynomial, up to
    /// rounding.
    ///
    /// # Errors
    /// As of [`HessianGram::new`].
    pub fn nearest(
        polynomial: &Polynomial,
        basis: Vec<HessianMonomial>,
        matrix: DMatrix<f64>,
    ) -> Result<Self, CertificateError> {
        let mut gram = Self::new(basis, matrix)?;
        gram.residuals(polynomial, None).close(&mut gram.matrix, |i, j| product(&gram.basis[i], &gram.basis[j]));
        Ok(gram)
    }

    /// As [`HessianGram::nearest`], of the sum of the polynomial and `power`.
    ///
    /// # Errors
    /// As of [`HessianGram::new`].
    pub fn nearest_with(
        polynomial: &Polynomial,
        power: &NormPower,
        basis: Vec<HessianMonomial>,
        matrix: DMatrix<f64>,
    ) -> Result<Self, CertificateError> {
        let mut gram = Self::new(basis, matrix)?;
        gram.residuals(polynomial, Some(power)).close(&mut gram.matrix, |i, j| product(&gram.basis[i], &gram.basis[j]));
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

    /// What the form of the polynomial, and of `power`, has beyond `wᵀ H w`.
    fn residuals(&self, polynomial: &Polynomial, power: Option<&NormPower>) -> Residuals<FormMonomial> {
        let mut residuals = Residuals::default();
        for &(exponents, coefficient) in polynomial.terms() {
            hessian_form(exponents).for_each(|(key, factor)| residuals.add(key, coefficient * factor, 0.0));
        }
        for &(exponents, coefficient, error) in power.iter().flat_map(|power| power.terms()) {
            hessian_form(exponents)
                .for_each(|(key, factor)| residuals.add(key, coefficient * factor, (error * factor).next_up()));
        }
        residuals.subtract(&self.matrix, |i, j| product(&self.basis[i], &self.basis[j]));
        residuals
    }

    /// Proves the polynomial sos-convex from these numbers alone: `λ_min(H) >= δ = √(Σ r_β² /
    /// n_β)`, residuals bounded with their rounding, the eigenvalue by Rump's criterion.
    ///
    /// # Errors
    /// What is missing for a proof, and by how much.
    pub fn prove(&self, polynomial: &Polynomial) -> Result<Margin, CertificateError> {
        Margin::of(&self.matrix, self.residual(polynomial, None)?)
    }

    /// Proves the sum of the polynomial and `power` sos-convex: the polynomial itself is, but for
    /// what `power` bends.
    ///
    /// # Errors
    /// What is missing for a proof, and by how much.
    pub fn prove_with(&self, polynomial: &Polynomial, power: &NormPower) -> Result<Margin, CertificateError> {
        Margin::of(&self.matrix, self.residual(polynomial, Some(power))?)
    }

    /// A proven c >= 0 with `yᵀ ∇²p(z) y >= c |y|²` for all y and z; 0 when there is none or none
    /// is found.
    ///
    /// `c |y|²` has the Gram matrix c E with ones where the basis has the plain components of y, so
    /// `H - c E` proves c as H proves 0. The largest c that leaves it positive definite is the
    /// smallest eigenvalue of the Schur complement of the rest.
    pub fn curvature_floor(&self, polynomial: &Polynomial) -> f64 {
        let plain: Vec<usize> = (0..self.basis.len()).filter(|&i| self.basis[i].exponents == [0, 0, 0]).collect();
        let rest: Vec<usize> = (0..self.basis.len()).filter(|i| !plain.contains(i)).collect();
        let (Ok(residual), 3) = (self.residual(polynomial, None), plain.len()) else { return 0.0 };
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
    fn residual(&self, polynomial: &Polynomial, power: Option<&NormPower>) -> Result<f64, CertificateError> {
        self.residuals(polynomial, power).norm().map_err(|(i, j, [a, b, c])| {
            CertificateError::BasisTooSmall(format!("Hessian term y{i} y{j} z^({a}, {b}, {c})"))
        })
    }
}
