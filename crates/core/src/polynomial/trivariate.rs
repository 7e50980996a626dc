//! Polynomials in three variables, stored as lists of terms and as the tables that they are
//! evaluated by.

use super::hessian_form::HessianForm;
use super::horner::Nested;
use super::jet::{Jet, NumberJet};
use super::line_root;
use super::monomial::{Exponents, degree_of};
use super::rounding::{AbsolutePolynomial, Growth};
use super::simd::Simd;
use super::simd_real::{Number, Schemes};
use nalgebra::Vector3;

/// Highest degree a polynomial may have.
pub const MAX_DEGREE: usize = 8;

/// A polynomial `p(z) = Σ c_e z^e` of even degree 2, 4, 6 or 8 in three variables.
///
/// Terms are stored in lexicographic order of their exponents, without zeros, so that equal
/// polynomials compare equal.
#[derive(Clone, Debug)]
pub struct Polynomial {
    terms: Vec<(Exponents, f64)>,
    pub(super) form: HessianForm,
    pub(super) nested: Nested,
    pub(super) absolute: AbsolutePolynomial,
}

/// Why a list of terms is not a polynomial of this service.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PolynomialError {
    /// The degree is odd, zero or above 8.
    #[error(
        "degree {0} is not one of 2, 4, 6, 8; a bounded convex body needs an even degree, and 8 is the highest served"
    )]
    Degree(usize),
    /// A coefficient is NaN or infinite.
    #[error("coefficient {index} of exponent {exponents:?} is {value}; every coefficient must be a finite number")]
    NotFinite {
        /// Position in the list of terms.
        index: usize,
        /// Exponents of the term.
        exponents: Exponents,
        /// The offending value.
        value: f64,
    },
    /// The same monomial occurs twice.
    #[error("exponent {0:?} occurs twice; add the coefficients into one term")]
    Duplicate(Exponents),
}

impl Polynomial {
    /// Builds a polynomial from `(exponents, coefficient)` terms in any order; zero coefficients
    /// are dropped.
    ///
    /// # Errors
    /// A degree other than 2, 4, 6, 8, a coefficient that is not finite, or a repeated monomial.
    pub fn new(mut terms: Vec<(Exponents, f64)>) -> Result<Self, PolynomialError> {
        for (index, &(exponents, value)) in terms.iter().enumerate() {
            if !value.is_finite() {
                return Err(PolynomialError::NotFinite { index, exponents, value });
            }
        }
        terms.sort_unstable_by_key(|term| term.0);
        if let Some(pair) = terms.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            return Err(PolynomialError::Duplicate(pair[0].0));
        }
        terms.retain(|term| term.1 != 0.0);
        let degree = terms.iter().map(|term| degree_of(term.0)).max().unwrap_or(0);
        if !matches!(degree, 2 | 4 | 6 | 8) {
            return Err(PolynomialError::Degree(degree));
        }
        let form = HessianForm::new(degree, &terms);
        let nested = Nested::new(degree, &terms);
        let absolute = AbsolutePolynomial::new(degree, &terms);
        Ok(Self { terms, form, nested, absolute })
    }

    /// Degree: 2, 4, 6 or 8.
    pub fn degree(&self) -> usize {
        self.form.degree()
    }

    /// Terms in lexicographic order of their exponents.
    pub fn terms(&self) -> &[(Exponents, f64)] {
        &self.terms
    }

    /// Value, gradient and Hessian at `z` in one pass (Euler's identity on the homogenized
    /// Hessian).
    #[inline]
    pub fn evaluate(&self, z: &Vector3<f64>) -> Jet {
        self.form.evaluate(z)
    }

    /// Value at `z`, with the error of that of [`Polynomial::evaluate`] at most.
    #[inline]
    pub(crate) fn value(&self, z: &Vector3<f64>) -> f64 {
        self.form.value(z)
    }

    /// Value, gradient and Hessian at the points `z`, a lane each, to be inlined into work for
    /// [`dispatch`](super::dispatch): as [`Polynomial::evaluate`] for one point, by nested Horner
    /// schemes for several.
    #[inline(always)]
    pub fn jet<S: Simd, N: Number<S>>(&self, simd: S, z: [N; 3]) -> NumberJet<N> {
        N::jet(simd, self, z)
    }

    /// About the first t in [-1, 1] at which the polynomial, if convex along the line, decreases to
    /// `level` at `middle + t half`; a t where it is low if it hardly does. A guess: nothing is
    /// proven of it.
    #[inline]
    pub fn first_below_along(&self, middle: &Vector3<f64>, half: &Vector3<f64>, level: f64) -> f64 {
        line_root::first_below(&self.nested, middle, half, level)
    }

    /// Bound of `|computed value - p(z')|` over all `z'` with `|z'_i - z_i| <= dz_i`, `gradient`
    /// being the computed one.
    ///
    /// Covers every rounding of [`Polynomial::evaluate`], the rounded products of its table
    /// included.
    #[inline]
    pub fn value_error(&self, z: &Vector3<f64>, gradient: &Vector3<f64>, dz: &Vector3<f64>) -> f64 {
        self.absolute.value_error(z, gradient, dz)
    }

    /// Bound of each component of `|computed gradient - ∇p(z')|` over all `z'` with `|z'_i - z_i|
    /// <= dz_i`.
    #[inline]
    pub fn gradient_error(&self, z: &Vector3<f64>, dz: &Vector3<f64>) -> f64 {
        self.absolute.gradient_error(z, dz)
    }

    /// Upper bound of the second derivatives along unit vectors at all points with `|z_i| <=
    /// radius`.
    pub fn curvature_ceiling(&self, radius: f64) -> f64 {
        self.absolute.curvature_ceiling(radius)
    }

    /// Bound of the error of computed second derivatives along unit vectors at all points with
    /// `|z_i| <= radius`.
    pub fn curvature_error(&self, radius: f64) -> f64 {
        self.absolute.curvature_error(radius)
    }

    /// Bounds at all points with `|z_i| <= coordinate`, `|z| <= length`: tighter by a power of √3
    /// for knowing both.
    #[inline(always)]
    pub fn growth(&self, coordinate: f64, length: f64) -> Growth {
        self.absolute.growth(coordinate, length)
    }

    /// The same polynomial with `delta` added to its constant coefficient (rounded once); every
    /// other coefficient, and with them the Hessian, stays bit-identical.
    pub fn with_constant_shifted(&self, delta: f64) -> Self {
        let mut terms = self.terms.clone();
        match terms.iter_mut().find(|term| term.0 == [0, 0, 0]) {
            Some(constant) => constant.1 += delta,
            None => terms.insert(0, ([0, 0, 0], delta)),
        }
        terms.retain(|term| term.1 != 0.0);
        let absolute = AbsolutePolynomial::new(self.degree(), &terms);
        // The constant enters the table only through F_00, but the table is cheap to make again.
        let form = HessianForm::new(self.degree(), &terms);
        let nested = Nested::new(self.degree(), &terms);
        Self { terms, form, nested, absolute }
    }
}

impl<S: Simd> Schemes<S> for Polynomial {
    #[inline(always)]
    fn one(&self, simd: S, z: [f64; 3]) -> NumberJet<f64> {
        self.form.jet(simd, z)
    }

    #[inline(always)]
    fn several<N: Number<S>>(&self, simd: S, z: [N; 3]) -> NumberJet<N> {
        self.nested.jet(simd, z)
    }
}

impl PartialEq for Polynomial {
    fn eq(&self, other: &Self) -> bool {
        self.terms == other.terms
    }
}
