//! Which Gram matrix an objective measures, and by which function.

use sublevel_core::body::Objective;

/// Which of the two Gram matrices an objective measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Matrix {
    /// P, of the polynomial.
    Polynomial,
    /// H, of its Hessian form.
    Hessian,
}

/// Which function of that matrix is minimised.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Function {
    /// `-log det Q`.
    LogDet,
    /// `tr Q⁻¹`.
    TraceInverse,
}

/// What the programs need to know of an objective.
pub(super) trait Measure {
    /// The matrix that it measures.
    fn matrix(self) -> Matrix;
    /// The function that it minimises.
    fn function(self) -> Function;
}

impl Measure for Objective {
    fn matrix(self) -> Matrix {
        match self {
            Self::LogDetP | Self::TraceP => Matrix::Polynomial,
            Self::LogDetH | Self::TraceH => Matrix::Hessian,
        }
    }

    fn function(self) -> Function {
        match self {
            Self::LogDetP | Self::LogDetH => Function::LogDet,
            Self::TraceP | Self::TraceH => Function::TraceInverse,
        }
    }
}
