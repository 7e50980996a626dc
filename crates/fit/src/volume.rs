//! Volume of `{p <= 1}` as a function of the coefficients of p, by quadrature over rays.
//!
//! With a inside and r(u) the radius of the set along u on the unit sphere, `V = ⅓ ∫ r³ du`. A
//! change of p by δ moves the boundary by `-δ/s`, s = u·∇p the slope along the ray, so that
//! `dV = -∫ r² δ/s du`: exact for the quadrature as for the integral. For curvature, p - 1 is taken
//! along the ray for a power of the distance with the exponent κ = r s it has at the boundary;
//! there `r ∝ (1 + δ)^(-1/κ)` and
//!
//! ```text
//! d²V ≈ ∫ r³ (1/κ)(1 + 3/κ) δ² du,
//! ```
//!
//! which is positive like the Gauss-Newton term `2 ∫ r (δ/s)² du` that it contains (times 3/2), and
//! exact for scaled copies of a homogeneous p, where the Gauss-Newton term is a fifth of it at
//! degree 6.

use super::structure::Structure;
use nalgebra::{DMatrix, DVector, Vector3};
use sublevel_core::body::{boundary_radius, sphere_rule};
use sublevel_core::polynomial::{Polynomial, PolynomialError};

/// Rings of rays: 2 x 36² = 2592 of them. Not the number that bodies are measured with, so that a
/// refinement that exploits the errors of one rule shows in the other.
const VOLUME_RINGS: usize = 36;

/// Volume, gradient and curvature with respect to the coefficients.
pub(super) struct Expansion {
    /// Volume in the frame of p.
    pub(super) volume: f64,
    /// Its gradient.
    pub(super) gradient: DVector<f64>,
    /// A positive semidefinite matrix near its second derivative.
    pub(super) curvature: DMatrix<f64>,
}

/// The polynomial with these coefficients.
pub(super) fn polynomial(structure: &Structure, coefficients: &DVector<f64>) -> Result<Polynomial, PolynomialError> {
    Polynomial::new(structure.monomials.iter().copied().zip(coefficients.iter().copied()).collect())
}

/// Volume about `center`, which must lie inside; infinite if it does not.
pub(super) fn volume(p: &Polynomial, center: &Vector3<f64>) -> f64 {
    if !(p.evaluate(center).value < 1.0) {
        return f64::INFINITY;
    }
    sphere_rule(VOLUME_RINGS).map(|(u, weight)| weight * boundary_radius(p, center, &u).powi(3)).sum::<f64>() / 3.0
}

/// Volume about `center` with its derivatives.
pub(super) fn expansion(structure: &Structure, p: &Polynomial, center: &Vector3<f64>) -> Expansion {
    let count = structure.monomials.len();
    let rays: Vec<_> = sphere_rule(VOLUME_RINGS).collect();
    let mut volume = 0.0;
    let mut gradient = DVector::zeros(count);
    let mut rows = DMatrix::zeros(count, rays.len());
    for ((u, weight), mut row) in rays.iter().zip(rows.column_iter_mut()) {
        let r = boundary_radius(p, center, u);
        let x = center + u * r;
        let slope = p.evaluate(&x).gradient.dot(u);
        let power = r * slope;
        let monomials = structure.values(&x);
        volume += weight * r.powi(3) / 3.0;
        gradient.axpy(-weight * r * r / slope, &monomials, 1.0);
        row.axpy((weight * r.powi(3) / power * (1.0 + 3.0 / power)).sqrt(), &monomials, 0.0);
    }
    Expansion { volume, gradient, curvature: &rows * rows.transpose() }
}
