//! What a moment matrix adds to the barrier problem of a path.

use super::spectral::log_det;
use super::structure::Pattern;
use nalgebra::{Cholesky, DMatrix, DVector};

/// `-w log det` of a moment matrix.
pub(super) struct Barrier<'a> {
    pub(super) pattern: &'a Pattern,
    /// w.
    pub(super) weight: f64,
}

impl Barrier<'_> {
    /// Its value; none unless the matrix is positive definite.
    pub(super) fn value(&self, moments: &DVector<f64>) -> Option<f64> {
        Some(-self.weight * log_det(&self.pattern.spread(moments))?)
    }

    /// Minus its gradient, as functional on Gram matrices collapsed to coefficients, and its
    /// Hessian.
    pub(super) fn derivatives(&self, moments: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let inverse = Cholesky::new(self.pattern.spread(moments))?.inverse();
        Some((self.pattern.collapse(&inverse) * self.weight, self.pattern.congruence(&inverse) * self.weight))
    }

    /// Minus its gradient at the moments `to`, to first order from `at`: a Gram matrix, positive
    /// definite when the step is below 1 in the local norm.
    pub(super) fn predicted(&self, at: &DVector<f64>, to: &DVector<f64>) -> Option<DMatrix<f64>> {
        let inverse = Cholesky::new(self.pattern.spread(at))?.inverse();
        let predicted = &inverse * 2.0 - &inverse * self.pattern.spread(to) * &inverse;
        Some((&predicted + predicted.transpose()) * (0.5 * self.weight))
    }
}
