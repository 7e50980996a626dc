//! Where a body stands: the map from a frame of points in metres to the body's normalized frame, with its error.

use super::Constraint;
use crate::polynomial::{Jet, gamma};
use nalgebra::{Matrix3, Vector3};

/// The affine map `z = M (v - o)` from points v of some frame to the normalized frame of a body, as computed, with bounds
/// of how far it is from the exact one. Within the body's own frame M is its `linear` and o its `center`.
#[derive(Clone, Debug)]
pub struct Placement {
    linear: Matrix3<f64>,
    origin: Vector3<f64>,
    /// Bound of the relative error of each row of `linear`, as a rotation error.
    rotation_error: f64,
    /// Bound of the distance between `origin` and the exact origin.
    origin_error: f64,
}

/// A constraint at a point: its jet in the placement's frame and bounds of the errors.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Value, and gradient and Hessian with respect to the point.
    pub jet: Jet,
    /// Bound of the error of the value.
    pub value_error: f64,
    /// Bound of the Euclidean norm of the error of the gradient.
    pub gradient_error: f64,
}

impl Sample {
    /// Rigorous upper bound of the value.
    pub fn value_upper(&self) -> f64 {
        (self.jet.value + self.value_error).next_up()
    }
}

impl Placement {
    /// Map with `linear` and `origin` exact but for the bounds given.
    pub fn new(linear: Matrix3<f64>, origin: Vector3<f64>, rotation_error: f64, origin_error: f64) -> Self {
        Self { linear, origin, rotation_error, origin_error }
    }

    /// `M` in `z = M (v - o)`.
    pub fn linear(&self) -> &Matrix3<f64> {
        &self.linear
    }

    /// `o` in `z = M (v - o)`.
    pub fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// Constraint at the point v, without error bounds.
    #[inline]
    pub fn jet(&self, constraint: &Constraint, v: &Vector3<f64>) -> Jet {
        self.pull_back(constraint.polynomial.evaluate(&(self.linear * (v - self.origin))))
    }

    /// Constraint at the point v, with error bounds.
    pub fn sample(&self, constraint: &Constraint, v: &Vector3<f64>) -> Sample {
        let offset = v - self.origin;
        let z = self.linear * offset;
        // v - o rounds once, the product with a row of M thrice more; M and o carry errors of their own.
        let moved = self.rotation_error * offset.norm() + self.origin_error;
        let dz = Vector3::from_fn(|i, _| {
            let row = self.linear.row(i);
            let rounding = gamma(6) * row.iter().zip(&offset).map(|(m, x)| (m * x).abs()).sum::<f64>();
            (rounding + row.norm() * moved) * (1.0 + 1e-14)
        });
        let jet = constraint.polynomial.evaluate(&z);
        let value_error = constraint.polynomial.value_error(&z, &jet.gradient, &dz);
        let rotated = gamma(6) + self.rotation_error;
        let gradient_error = self.linear.norm()
            * (2.0 * constraint.polynomial.gradient_error(&z, &dz) + rotated * jet.gradient.norm())
            * (1.0 + 1e-14);
        Sample { jet: self.pull_back(jet), value_error, gradient_error }
    }

    fn pull_back(&self, jet: Jet) -> Jet {
        let transposed = self.linear.transpose();
        Jet { value: jet.value, gradient: transposed * jet.gradient, hessian: transposed * jet.hessian * self.linear }
    }
}
