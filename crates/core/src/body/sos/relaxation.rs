//! How far a polynomial is from sos-convex.

use crate::polynomial::{HessianGram, NormPower};
use nalgebra::{Matrix3, Vector3};

/// How far a polynomial is from sos-convex: `p(z) + c |linear z + offset|^degree` is, degree being
/// that of p (Ahmadi, Hall, Makadia and Sindhwani, RSS 2017, section III).
#[derive(Clone, Debug, PartialEq)]
pub struct Relaxation {
    /// c > 0: unit-free, as the coordinates that it belongs to.
    pub c: f64,
    /// Linear part of the map from the normalized frame to these coordinates.
    pub linear: Matrix3<f64>,
    /// Its constant part.
    pub offset: Vector3<f64>,
    /// Gram matrix of the Hessian form of the sum.
    pub gram: HessianGram,
}

impl Relaxation {
    /// What is added to a polynomial of this degree.
    pub(crate) fn power(&self, degree: usize) -> NormPower {
        NormPower::new(self.c, &self.linear, &self.offset, degree)
    }
}
