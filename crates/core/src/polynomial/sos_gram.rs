//! Proof that a polynomial is a sum of squares: a Gram matrix of the polynomial itself.
//!
//! As of a Hessian form (`gram`), with the monomials of half the degree for a basis: `p = mᵀ P m`
//! with P definite beyond the residual of floating point.

use super::Polynomial;
use super::certificate_error::CertificateError;
use super::gram::Margin;
use super::monomial::{Exponents, degree_of};
use super::residual::{Residuals, check_matrix};
use super::verified_cholesky::is_positive_definite_above;
use nalgebra::DMatrix;

/// A Gram matrix of `p(z)` on a basis of monomials, which may be fewer than all of half the degree.
#[derive(Clone, Debug, PartialEq)]
pub struct SosGram {
    basis: Vec<Exponents>,
    matrix: DMatrix<f64>,
}

impl SosGram {
    /// A Gram matrix on a basis.
    ///
    /// # Errors
    /// A basis that is empty, repeated or has monomials above degree 4; a matrix that is not
    /// square, symmetric, finite and of the basis' size.
    pub fn new(basis: Vec<Exponents>, matrix: DMatrix<f64>) -> Result<Self, CertificateError> {
        let malformed = |why: String| Err(CertificateError::Malformed(why));
        if basis.is_empty() {
            return malformed("its basis is empty".into());
        }
        if let Some(bad) = basis.iter().find(|&&e| degree_of(e) > 4) {
            return malformed(format!("basis element {bad:?} is out of range (degree at most 4)"));
        }
        let mut sorted = basis.clone();
        sorted.sort_unstable();
        if sorted.windows(2).any(|pair| pair[0] == pair[1]) {
            return malformed("a basis element occurs twice".into());
        }
        check_matrix(&matrix, basis.len())?;
        Ok(Self { basis, matrix })
    }

    /// The matrix closest to `matrix` (Frobenius norm) whose form matches the polynomial, up to
    /// rounding.
    ///
    /// # Errors
    /// As of [`SosGram::new`].
    pub fn nearest(
        polynomial: &Polynomial,
        basis: Vec<Exponents>,
        matrix: DMatrix<f64>,
    ) -> Result<Self, CertificateError> {
        let mut gram = Self::new(basis, matrix)?;
        gram.residuals(polynomial).close(&mut gram.matrix, |i, j| product(gram.basis[i], gram.basis[j]));
        Ok(gram)
    }

    /// Basis of the certificate.
    pub fn basis(&self) -> &[Exponents] {
        &self.basis
    }

    /// Symmetric Gram matrix, rows and columns in the order of the basis.
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// Proves the polynomial a sum of squares from these numbers alone.
    ///
    /// # Errors
    /// What is missing for a proof, and by how much.
    pub fn prove(&self, polynomial: &Polynomial) -> Result<Margin, CertificateError> {
        Margin::of(&self.matrix, self.residual(polynomial)?)
    }

    /// A proven ρ >= 0 with `p(z) >= ρ (z^e)²` for all z, e being an element of the basis; 0 when
    /// there is none or none is found.
    ///
    /// `P - ρ E` with a single one in E proves ρ as P proves 0. The largest that leaves it positive
    /// definite is `1/(P⁻¹)_ee`.
    pub fn floor(&self, polynomial: &Polynomial, e: Exponents) -> f64 {
        let (Some(i), Ok(residual)) = (self.basis.iter().position(|&b| b == e), self.residual(polynomial)) else {
            return 0.0;
        };
        let Some(factor) = self.matrix.clone().cholesky() else { return 0.0 };
        let unit = DMatrix::from_fn(self.basis.len(), 1, |row, _| f64::from(u8::from(row == i)));
        let estimate = 1.0 / factor.solve(&unit)[(i, 0)];
        // What rounding and the residual take decides how close to the estimate a proof gets.
        let proven = |floor: f64| {
            let mut lowered = self.matrix.clone();
            lowered[(i, i)] = (lowered[(i, i)] - floor).next_down();
            is_positive_definite_above(&lowered, residual)
        };
        let candidates = [0.999, 0.9, 0.5, 0.1, 0.01].map(|factor| factor * estimate);
        candidates.into_iter().find(|&floor| floor > 0.0 && proven(floor)).unwrap_or(0.0)
    }

    fn residuals(&self, polynomial: &Polynomial) -> Residuals<Exponents> {
        let mut residuals = Residuals::default();
        polynomial.terms().iter().for_each(|&(exponents, coefficient)| residuals.add(exponents, coefficient, 0.0));
        residuals.subtract(&self.matrix, |i, j| product(self.basis[i], self.basis[j]));
        residuals
    }

    fn residual(&self, polynomial: &Polynomial) -> Result<f64, CertificateError> {
        self.residuals(polynomial)
            .norm()
            .map_err(|[a, b, c]| CertificateError::BasisTooSmall(format!("term z^({a}, {b}, {c})")))
    }
}

fn product(a: Exponents, b: Exponents) -> Exponents {
    std::array::from_fn(|i| a[i] + b[i])
}

#[cfg(test)]
mod tests {
    use super::SosGram;
    use crate::polynomial::{CertificateError, Exponents, Polynomial, monomials};
    use nalgebra::{DMatrix, Vector3};
    use std::collections::BTreeMap;
    use sublevel_testkit::Seeded;

    /// A random definite Gram matrix with the polynomial that it gives, rounded.
    fn random(seed: u64, degree: usize) -> (Polynomial, SosGram) {
        let mut random = Seeded(seed);
        let basis = monomials(degree / 2);
        let n = basis.len();
        let root = DMatrix::from_fn(n, n, |_, _| random.signed());
        let matrix = &root * root.transpose() + DMatrix::identity(n, n) * 1e-3;
        let matrix = (&matrix + matrix.transpose()) * 0.5;
        let mut terms: BTreeMap<Exponents, f64> = BTreeMap::new();
        for i in 0..n {
            for j in 0..n {
                *terms.entry(std::array::from_fn(|k| basis[i][k] + basis[j][k])).or_default() += matrix[(i, j)];
            }
        }
        (Polynomial::new(terms.into_iter().collect()).unwrap(), SosGram::new(basis, matrix).unwrap())
    }

    #[test]
    fn definite_matrices_prove_and_perturbed_ones_fail() {
        for seed in 0..20 {
            for degree in [2, 4, 6, 8] {
                let (p, gram) = random(seed, degree);
                assert!(gram.prove(&p).is_ok(), "seed {seed}, degree {degree}");
                // A constant that the matrix does not give: its least eigenvalue covers less than
                // that.
                let least = gram.matrix().symmetric_eigenvalues().min();
                assert!(gram.prove(&p.with_constant_shifted(-0.9 * least)).is_ok());
                let other = p.with_constant_shifted(-1.1 * least);
                assert!(matches!(gram.prove(&other), Err(CertificateError::NotDefinite { .. })));
                // An indefinite matrix.
                let matrix = gram.matrix() - DMatrix::identity(gram.basis().len(), gram.basis().len()) * (1.01 * least);
                assert!(SosGram::nearest(&p, gram.basis().to_vec(), gram.matrix().clone()).unwrap().prove(&p).is_ok());
                let lowered = SosGram::new(gram.basis().to_vec(), matrix).unwrap();
                assert!(lowered.prove(&p).is_err());
            }
        }
    }

    #[test]
    fn floors_hold_everywhere_and_are_near_the_best() {
        for seed in 0..10 {
            let degree = 4;
            let (p, gram) = random(seed, degree);
            let mut random = Seeded(1000 + seed);
            for (row, &e) in gram.basis().iter().enumerate() {
                let floor = gram.floor(&p, e);
                let best = 1.0 / gram.matrix().clone().try_inverse().unwrap()[(row, row)];
                assert!(floor > 0.99 * best && floor < best, "seed {seed}: {floor} of {best}");
                for _ in 0..200 {
                    let z = Vector3::from_fn(|_, _| 3.0 * random.signed());
                    let monomial: f64 = (0..3).map(|i| z[i].powi(i32::from(e[i]))).product();
                    assert!(p.evaluate(&z).value >= floor * monomial * monomial * (1.0 - 1e-9));
                }
            }
        }
    }

    #[test]
    fn what_is_malformed_is_refused() {
        let (p, gram) = random(1, 4);
        let (basis, matrix) = (gram.basis().to_vec(), gram.matrix().clone());
        let small = SosGram::new(basis[..4].to_vec(), matrix.view((0, 0), (4, 4)).into_owned()).unwrap();
        assert!(matches!(small.prove(&p), Err(CertificateError::BasisTooSmall(_))));
        assert!(SosGram::new(basis[..3].to_vec(), matrix.clone()).is_err());
        assert!(SosGram::new(vec![], DMatrix::zeros(0, 0)).is_err());
        assert!(SosGram::new(vec![[5, 0, 0]], DMatrix::identity(1, 1)).is_err());
        assert!(SosGram::new(vec![[1, 0, 0]; 2], DMatrix::identity(2, 2)).is_err());
        let mut broken = matrix;
        broken[(0, 1)] = f64::NAN;
        assert!(SosGram::new(basis, broken).is_err());
    }
}
