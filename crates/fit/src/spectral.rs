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
//! concave in X, with the minimiser Q as its gradient. Both are sums over the eigenvalues of X, so
//! that the curvature follows from divided differences (Daleckii and Krein): with `X = UΛUᵀ`,
//!
//! ```text
//! -D²φ[Δ, Δ] = Σ κ(λᵢ, λⱼ) (UᵀΔU)ᵢⱼ²,   κ = 1/(λᵢλⱼ)   or   κ = 1/(√λᵢ √λⱼ (√λᵢ + √λⱼ)).
//! ```

use super::objective::Function;
use super::structure::Pattern;
use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

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

    /// Whether Newton's method does on φ.
    pub(super) fn is_self_concordant(&self) -> bool {
        self.function == Function::LogDet
    }

    /// `⟨X, Q⟩` at the minimiser Q over the number of rows N: the unit that gaps are measured in, 1
    /// for log dets.
    pub(super) fn size(&self, matrix: &DMatrix<f64>) -> Option<f64> {
        match self.function {
            Function::LogDet => Some(1.0),
            Function::TraceInverse => {
                Some(self.eigen(matrix)?.0.iter().map(|value| value.sqrt()).sum::<f64>() / matrix.nrows() as f64)
            }
        }
    }

    /// Eigenvalues of X and `E = UᵀT`, so that `E M Eᵀ = Λ`; none unless all are positive.
    fn eigen(&self, matrix: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let moved = match &self.change {
            Some(change) => change * matrix * change.transpose(),
            None => matrix.clone(),
        };
        if !moved.iter().all(|v| v.is_finite()) {
            return None;
        }
        let eigen = SymmetricEigen::new(symmetric(moved));
        let least = eigen.eigenvalues.min();
        if least.is_nan() || least <= 0.0 {
            return None;
        }
        let turn = eigen.eigenvectors.transpose();
        let turn = self.change.as_ref().map_or_else(|| turn.clone(), |change| &turn * change);
        Some((eigen.eigenvalues, turn))
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
            Function::TraceInverse => Some(2.0 * self.eigen(matrix)?.0.iter().map(|value| value.sqrt()).sum::<f64>()),
        }
    }

    /// The minimiser P in the whitened frame: the gradient of φ.
    pub(super) fn minimiser(&self, matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        match self.function {
            Function::LogDet => Some(Cholesky::new(matrix.clone())?.inverse()),
            Function::TraceInverse => {
                let (values, turn) = self.eigen(matrix)?;
                Some(turn.tr_mul(&(DMatrix::from_diagonal(&values.map(|v| 1.0 / v.sqrt())) * &turn)))
            }
        }
    }

    /// The matrix of the quadratic form `-D²φ` on moments: keys x keys.
    pub(super) fn curvature(&self, pattern: &Pattern, matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        match self.function {
            Function::LogDet => Some(pattern.congruence(&self.minimiser(matrix)?)),
            Function::TraceInverse => {
                let (values, turn) = self.eigen(matrix)?;
                let n = values.len();
                let mut rows = DMatrix::<f64>::zeros(pattern.keys, n * (n + 1) / 2);
                let mut column = 0;
                for i in 0..n {
                    for j in 0..=i {
                        // both entries (i, j) and (j, i)
                        let weight = (divided(values[i], values[j]) * if i == j { 1.0 } else { 2.0 }).sqrt();
                        for k in 0..n {
                            for l in 0..n {
                                rows[(pattern.key(k, l), column)] += weight * turn[(i, k)] * turn[(j, l)];
                            }
                        }
                        column += 1;
                    }
                }
                Some(&rows * rows.transpose())
            }
        }
    }

    /// The minimiser at moment matrix `to`, to first order from `at`.
    pub(super) fn predicted(&self, at: &DMatrix<f64>, to: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        match self.function {
            Function::LogDet => {
                let gram = self.minimiser(at)?;
                Some(&gram * 2.0 - &gram * to * &gram)
            }
            Function::TraceInverse => {
                let (values, turn) = self.eigen(at)?;
                let change = &turn * (to - at) * turn.transpose();
                let inner = DMatrix::from_fn(values.len(), values.len(), |i, j| {
                    let here = if i == j { 1.0 / values[i].sqrt() } else { 0.0 };
                    here - divided(values[i], values[j]) * change[(i, j)]
                });
                Some(turn.tr_mul(&(inner * &turn)))
            }
        }
    }
}

/// Its symmetric part: rounding leaves products a little unsymmetric.
pub(super) fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    (&matrix + matrix.transpose()) * 0.5
}

/// κ of `tr Q⁻¹`.
fn divided(a: f64, b: f64) -> f64 {
    let (a, b) = (a.sqrt(), b.sqrt());
    1.0 / (a * b * (a + b))
}

/// `log det` of a positive definite matrix.
pub(super) fn log_det(matrix: &DMatrix<f64>) -> Option<f64> {
    let factor = Cholesky::new(matrix.clone())?;
    let value = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    value.is_finite().then_some(value)
}
