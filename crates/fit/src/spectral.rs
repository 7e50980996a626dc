//! The objectives as functions of a Gram matrix, and their conjugates as functions of the moment
//! matrix.
//!
//! A Gram matrix Q measured by `f(Q)` enters the dual of a fit by
//!
//! ```text
//! φ(X) = inf over Q ≻ 0 of f(Q) + ⟨X, Q⟩,
//!   f = -log det Q:  φ = log det X + N  at Q = X⁻¹,
//!   f = tr Q⁻¹:      φ = 2 tr X^½       at Q = X^-½,
//! ```
//!
//! concave in X, with the minimiser Q as its gradient.

use super::objective::Function;
use nalgebra::{Cholesky, DMatrix, DVector};

/// f, measured in a frame of its own: with T the change of basis into that frame, `P = TᵀQT` and `X
/// = TMTᵀ` (`basis`).
#[derive(Clone, Debug)]
pub(super) struct Spectral {
    function: Function,
    /// T; none where the frame makes no difference but a constant.
    change: Option<DMatrix<f64>>,
}

impl Spectral {
    /// `-log det` in the whitened frame.
    pub(super) fn log_det() -> Self {
        Self { function: Function::LogDet, change: None }
    }

    /// `tr Q⁻¹` in the frame that `change` leads to.
    pub(super) fn trace_inverse(change: DMatrix<f64>) -> Self {
        Self { function: Function::TraceInverse, change: Some(change) }
    }

    /// Which function it is.
    pub(super) fn function(&self) -> Function {
        self.function
    }

    /// T.
    pub(super) fn change(&self) -> Option<&DMatrix<f64>> {
        self.change.as_ref()
    }

    /// Eigenvalues of X; none unless all are positive.
    fn eigenvalues(&self, matrix: &DMatrix<f64>) -> Option<DVector<f64>> {
        let moved = match &self.change {
            Some(change) => change * matrix * change.transpose(),
            None => matrix.clone(),
        };
        if !moved.iter().all(|v| v.is_finite()) {
            return None;
        }
        let eigenvalues = ((&moved + moved.transpose()) * 0.5).symmetric_eigenvalues();
        (eigenvalues.min() > 0.0).then_some(eigenvalues)
    }

    /// f of a Gram matrix P of the whitened frame; none unless it is positive definite.
    pub(super) fn measure(&self, gram: &DMatrix<f64>) -> Option<f64> {
        match self.function {
            Function::LogDet => log_det(gram).map(|value| -value),
            Function::TraceInverse => {
                // Q⁻¹ = TP⁻¹Tᵀ
                let change = self.change.clone().unwrap_or_else(|| DMatrix::identity(gram.nrows(), gram.nrows()));
                let half = Cholesky::new(gram.clone())?.l().solve_lower_triangular(&change.transpose())?;
                Some(half.norm_squared())
            }
        }
    }

    /// φ at the moment matrix M of the whitened frame; none unless it is positive definite.
    pub(super) fn bound(&self, matrix: &DMatrix<f64>) -> Option<f64> {
        match self.function {
            Function::LogDet => Some(log_det(matrix)? + matrix.nrows() as f64),
            Function::TraceInverse => {
                Some(2.0 * self.eigenvalues(matrix)?.iter().map(|value| value.sqrt()).sum::<f64>())
            }
        }
    }

    /// `φ(tM) - t c` at the best t; none unless M is positive definite and c positive.
    pub(super) fn best_multiple(&self, matrix: &DMatrix<f64>, cost: f64) -> Option<f64> {
        let bound = self.bound(matrix).filter(|_| cost > 0.0)?;
        let rows = matrix.nrows() as f64;
        Some(match self.function {
            // N log t - t c
            Function::LogDet => bound + rows * (rows / cost).ln() - rows,
            // t^½ φ - t c
            Function::TraceInverse => 0.25 * bound * bound / cost,
        })
    }
}

/// `log det` of a positive definite matrix.
pub(super) fn log_det(matrix: &DMatrix<f64>) -> Option<f64> {
    let factor = Cholesky::new(matrix.clone())?;
    let value = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    value.is_finite().then_some(value)
}
