//! Value, gradient and Hessian at a point, or at several side by side.

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

/// Value, gradient and Hessian (xx, xy, xz, yy, yz, zz) in every lane.
#[derive(Clone, Copy, Debug)]
pub struct NumberJet<N> {
    /// Value.
    pub value: N,
    /// Gradient.
    pub gradient: [N; 3],
    /// Distinct entries of the symmetric Hessian: xx, xy, xz, yy, yz, zz.
    pub hessian: [N; 6],
}
