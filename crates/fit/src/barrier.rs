//! What a moment matrix adds to the barrier problem of a path.

use super::spectral::{Spectral, symmetric};
use super::structure::Pattern;
use nalgebra::{DMatrix, DVector};

/// `-τφ - log det` of a moment matrix, of which either part may be missing.
///
/// `-log det` alone keeps an unmeasured matrix definite. A log det that is measured is its own
/// barrier. `tr X^½` is none: Newton's method on it creeps along the boundary; but matrix monotone
/// functions become self-concordant once `-log det` is added (Faybusovich and Tsuchiya, Optim.
/// Lett. 11, 2017).
pub(super) struct Barrier<'a> {
    pattern: &'a Pattern,
    parts: Vec<(Spectral, f64)>,
}

impl<'a> Barrier<'a> {
    /// `measured` is φ with its factor τ, if the objective measures this matrix.
    pub(super) fn new(pattern: &'a Pattern, measured: Option<(&Spectral, f64)>) -> Self {
        let guard = measured.is_none_or(|(spectral, _)| !spectral.is_self_concordant());
        let guard = guard.then(|| (Spectral::log_det(), 1.0));
        Self {
            pattern,
            parts: measured.map(|(spectral, tau)| (spectral.clone(), tau)).into_iter().chain(guard).collect(),
        }
    }

    /// Its value; none unless the matrix is positive definite.
    pub(super) fn value(&self, moments: &DVector<f64>) -> Option<f64> {
        let matrix = self.pattern.spread(moments);
        self.parts.iter().map(|(spectral, weight)| Some(-weight * spectral.bound(&matrix)?)).sum()
    }

    /// Minus its gradient, as functional on Gram matrices collapsed to coefficients, and its
    /// Hessian.
    pub(super) fn derivatives(&self, moments: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let matrix = self.pattern.spread(moments);
        let of_part = |(spectral, weight): &(Spectral, f64)| Some(spectral.minimiser(&matrix)? * *weight);
        let gram = self.parts.iter().map(of_part).sum::<Option<DMatrix<f64>>>()?;
        let of_part = |(spectral, weight): &(Spectral, f64)| Some(spectral.curvature(self.pattern, &matrix)? * *weight);
        let curvature = self.parts.iter().map(of_part).sum::<Option<DMatrix<f64>>>()?;
        Some((self.pattern.collapse(&gram), curvature))
    }

    /// Minus its gradient at the moments `to`, to first order from `at`: a Gram matrix.
    ///
    /// Positive definite when the step is below 1 in the local norm, since that of `-log det` is
    /// part of it.
    pub(super) fn predicted(&self, at: &DVector<f64>, to: &DVector<f64>) -> Option<DMatrix<f64>> {
        let (at, to) = (self.pattern.spread(at), self.pattern.spread(to));
        let of_part = |(spectral, weight): &(Spectral, f64)| Some(spectral.predicted(&at, &to)? * *weight);
        self.parts.iter().map(of_part).sum::<Option<DMatrix<f64>>>().map(symmetric)
    }
}
