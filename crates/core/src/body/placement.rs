//! Where a body stands: the map from a frame of points in metres to the body's normalized frame,
//! with its error.
//!
//! A computed map `z = M (v - o)` never is the exact one, and its product rounds. Both errors are
//! the same as moving the point: the computed z is the exact image of a point v̂ near v.
//! [`Placement::displacement`] bounds |v̂ - v|. A distance then loses just that displacement; a
//! claim about the point v itself ([`Sample::value_upper`]) needs the polynomial's change over it.

use super::Constraint;
use crate::polynomial::{Jet, Polynomial, gamma};
use nalgebra::{Matrix3, Vector3};

/// The affine map `z = M (v - o)` from points v of some frame to the normalized frame of a body.
/// Within the body's own frame M is its `linear` and o its `center`.
#[derive(Clone, Debug)]
pub struct Placement {
    linear: Matrix3<f64>,
    inverse: Matrix3<f64>,
    /// Bounds of the distance of each column of `inverse` from that of the exact inverse.
    inverse_errors: Vector3<f64>,
    origin: Vector3<f64>,
    row_norms: Vector3<f64>,
    /// Displacement per distance from the origin.
    relative_error: f64,
    /// Displacement at the origin.
    origin_error: f64,
}

/// A constraint at a point, with bounds of the errors that are asked for.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    placement: &'a Placement,
    polynomial: &'a Polynomial,
    /// Normalized coordinates of the point.
    z: Vector3<f64>,
    /// Bound of the distance between the point and the one whose exact image z is.
    displacement: f64,
    /// The jet with respect to z.
    jet: Jet,
}

impl Sample<'_> {
    /// Value.
    pub fn value(&self) -> f64 {
        self.jet.value
    }

    /// Gradient with respect to the point.
    pub fn gradient(&self) -> Vector3<f64> {
        self.placement.linear.tr_mul(&self.jet.gradient)
    }

    /// Gradient with respect to the normalized coordinates z.
    pub fn z_gradient(&self) -> &Vector3<f64> {
        &self.jet.gradient
    }

    /// Rigorous upper bound of the value at the point itself and all others within `distance` of
    /// it.
    pub fn value_upper(&self, distance: f64) -> f64 {
        let dz = self.placement.row_norms * (self.displacement + distance);
        (self.jet.value + self.polynomial.value_error(&self.z, &self.jet.gradient, &dz)).next_up()
    }

    /// Bound of the error of the value as that of a point within the displacement.
    pub fn nearby_value_error(&self) -> f64 {
        self.polynomial.value_error(&self.z, &self.jet.gradient, &Vector3::zeros())
    }

    /// Rigorous upper bound of the value at a point within the displacement.
    pub fn nearby_value_upper(&self) -> f64 {
        (self.jet.value + self.nearby_value_error()).next_up()
    }

    /// Bound of the error of each component of [`Sample::z_gradient`] at that nearby point.
    pub fn z_gradient_error(&self) -> f64 {
        self.polynomial.gradient_error(&self.z, &Vector3::zeros())
    }

    /// Bound of the Euclidean norm of the error of [`Sample::gradient`] at that nearby point.
    pub fn gradient_error(&self) -> f64 {
        // Pulling back turns and rounds the gradient; the polynomial's own error passes through M.
        let own =
            (2.0 * self.z_gradient_error() + gamma(12) * self.jet.gradient.norm()) * self.placement.row_norms.norm();
        ((self.placement.relative_error + gamma(12)) * self.gradient().norm() + own) * (1.0 + 1e-14)
    }
}

impl Placement {
    /// The map with `linear = L Rᵀ` and its `inverse`, both computed with at most three roundings
    /// per entry from an invertible `L` and its inverse, where `R` is within `rotation_error` of
    /// the exact rotation and `origin` within `origin_error` of the exact origin.
    pub fn new(
        linear: Matrix3<f64>,
        inverse: Matrix3<f64>,
        origin: Vector3<f64>,
        rotation_error: f64,
        origin_error: f64,
    ) -> Self {
        let row_norms = Vector3::from_fn(|i, _| linear.row(i).norm() * (1.0 + 1e-14));
        // An error of at most ε |M_i| |v - o| in each z_i is a displacement of at most ε K |v - o|,
        // with K the sum of row norms of M times column norms of its inverse: 3 when the rows of L
        // are orthogonal. The entries of M and the product with v - o round seven times together.
        let columns = Vector3::from_fn(|i, _| inverse.column(i).norm() * (1.0 + 1e-14));
        let k = row_norms.dot(&columns) * (1.0 + 1e-5);
        let relative_error = rotation_error + gamma(16) * k;
        // The exact inverse is inverse (I + E)⁻¹, E what the exact M times `inverse` is off the
        // identity.
        let off = (linear * inverse - Matrix3::identity()).abs();
        let inverse_errors = Vector3::from_fn(|i, _| {
            let off = |j: usize| off[(j, i)] + (rotation_error + gamma(12)) * row_norms[j] * columns[i];
            1.01 * (0..3).map(|j| columns[j] * off(j)).sum::<f64>() + gamma(8) * columns[i]
        });
        Self { linear, inverse, inverse_errors, origin, row_norms, relative_error, origin_error }
    }

    /// `M` in `z = M (v - o)`.
    pub fn linear(&self) -> &Matrix3<f64> {
        &self.linear
    }

    /// `o` in `z = M (v - o)`.
    pub fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// Bounds of the norms of the rows of `M`: how much each z_i changes per metre.
    pub fn row_norms(&self) -> &Vector3<f64> {
        &self.row_norms
    }

    /// A linear functional `r·(v' - v̂)` of points as one of their normalized coordinates, `M⁻ᵀ r`,
    /// with a bound of the error of each component.
    pub fn functional(&self, r: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        (self.inverse.transpose() * r, self.inverse_errors * (r.norm() * (1.0 + 1e-14)))
    }

    /// Bounds of `|z'_i - z_i|` between the image of v and those of points with `|z'_i| <=
    /// extent_i`.
    pub fn spans(&self, v: &Vector3<f64>, extent: &Vector3<f64>) -> Vector3<f64> {
        let z = self.coordinates(v);
        (extent + z.abs() + self.row_norms * self.displacement(v)) * (1.0 + 1e-14)
    }

    /// Bound of the distance between v and the point whose exact image is the computed one of v.
    #[inline]
    pub fn displacement(&self, v: &Vector3<f64>) -> f64 {
        (self.relative_error * (v - self.origin).norm() + self.origin_error) * (1.0 + 1e-14)
    }

    /// Normalized coordinates of the point v, as they are computed.
    #[inline]
    pub(crate) fn coordinates(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.linear * (v - self.origin)
    }

    /// Constraint at the point v, without error bounds.
    #[inline]
    pub fn jet(&self, constraint: &Constraint, v: &Vector3<f64>) -> Jet {
        self.pull_back(constraint.polynomial.evaluate(&self.coordinates(v)))
    }

    /// Constraint at the point v, with error bounds.
    #[inline]
    pub fn sample<'a>(&'a self, constraint: &'a Constraint, v: &Vector3<f64>) -> Sample<'a> {
        self.sample_of(&constraint.polynomial, v)
    }

    /// Polynomial of the normalized frame at the point v, with error bounds.
    #[inline]
    pub fn sample_of<'a>(&'a self, polynomial: &'a Polynomial, v: &Vector3<f64>) -> Sample<'a> {
        let z = self.coordinates(v);
        self.sample_at(polynomial, v, (z, polynomial.evaluate(&z)))
    }

    /// The same for a polynomial that has been evaluated at the normalized coordinates of v.
    #[inline]
    pub(crate) fn sample_at<'a>(
        &'a self,
        polynomial: &'a Polynomial,
        v: &Vector3<f64>,
        (z, jet): (Vector3<f64>, Jet),
    ) -> Sample<'a> {
        Sample { placement: self, polynomial, z, displacement: self.displacement(v), jet }
    }

    /// A jet by normalized coordinates as one by points.
    #[inline]
    pub(crate) fn pull_back(&self, jet: Jet) -> Jet {
        let transposed = self.linear.transpose();
        Jet { value: jet.value, gradient: transposed * jet.gradient, hessian: transposed * jet.hessian * self.linear }
    }
}
