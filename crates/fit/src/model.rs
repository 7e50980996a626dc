//! A convex quadratic function of the coefficients of p, and its dual as a function of the moments.

use super::factor::regularised_factor;
use nalgebra::{DMatrix, DVector};

/// `F(c) = g·(c - c0) + ½ (c - c0)ᵀ B (c - c0)` with B ≻ 0.
///
/// In the dual of a program that minimises F it stands where -φ stands in that of a fit: as the
/// conjugate `½ (m + g)ᵀ B⁻¹ (m + g) - c0·(m + g)` (up to a constant), whose negative gradient is
/// the minimiser c.
#[derive(Clone, Debug)]
pub(super) struct Model {
    origin: DVector<f64>,
    slope: DVector<f64>,
    curvature: DMatrix<f64>,
    /// Lower Cholesky factor of B.
    factor: DMatrix<f64>,
}

impl Model {
    /// The model around coefficients `origin` (c0) with gradient `slope` (g) and curvature B; none
    /// unless B is positive definite up to rounding.
    pub(super) fn new(origin: DVector<f64>, slope: DVector<f64>, curvature: DMatrix<f64>) -> Option<Self> {
        let factor = regularised_factor(&curvature)?;
        Some(Self { origin, slope, curvature, factor })
    }

    /// The conjugate at moments m.
    pub(super) fn value(&self, moments: &DVector<f64>) -> f64 {
        let change = moments + &self.slope;
        let half = self.factor.solve_lower_triangular(&change).unwrap_or_else(|| DVector::repeat(1, f64::NAN));
        0.5 * half.norm_squared() - self.origin.dot(&change)
    }

    /// The minimiser c of `F(c) + m·c`.
    pub(super) fn coefficients(&self, moments: &DVector<f64>) -> DVector<f64> {
        let mut change = moments + &self.slope;
        // the factor has a positive diagonal
        self.factor.solve_lower_triangular_mut(&mut change);
        self.factor.tr_solve_lower_triangular_mut(&mut change);
        &self.origin - change
    }

    /// `F(c) = ½ cᵀBc + q·c` but for a constant: q and B.
    pub(super) fn terms(&self) -> (DVector<f64>, &DMatrix<f64>) {
        (&self.slope - &self.curvature * &self.origin, &self.curvature)
    }

    /// B: the inverse of the conjugate's Hessian.
    pub(super) fn flexibility(&self) -> &DMatrix<f64> {
        &self.curvature
    }
}
