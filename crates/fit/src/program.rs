//! The semidefinite program of one fit and its dual.
//!
//! The programs of the paper (its section III, convex case) in the whitened frame, with a margin ε:
//!
//! ```text
//! minimise  f(P) or f(H)   subject to  p = zᵀPz,  yᵀ∇²p y = wᵀHw,  P ⪰ 0,  H ⪰ εI,  p(xᵢ) <= 1
//! ```
//!
//! Their duals have far fewer variables: weights w >= 0 of the points and a functional s on the
//! Hessian form. With φ the concave conjugate of f (`spectral`), for the Gram matrix P
//!
//! ```text
//! maximise  φ(M(m)) - Σwᵢ + ε tr S(s)   subject to  m = Σ wᵢ v(xᵢ) - D*s,  S(s) ⪰ 0,  w >= 0
//! ```
//!
//! where M and S are (pseudo-)moment matrices, v the monomials of p and D the map from p to its
//! Hessian form; P is then implied definite. For the Gram matrix H the two change roles, and f
//! alone keeps H definite, so there is no ε:
//!
//! ```text
//! maximise  φ(S(s)) - Σwᵢ   subject to  m = Σ wᵢ v(xᵢ) - D*s,  M(m) ⪰ 0,  w >= 0
//! ```
//!
//! With convexity relaxed, `p + r` is sos-convex in place of p, for `r = c |u|^2d` in given
//! coordinates u: with h the coefficients of the Hessian form of r, the constraint `yᵀ∇²(p + r) y =
//! wᵀHw` takes `h·s` off the dual objective, and nothing else changes.
//!
//! The optimal Gram matrix is the gradient of φ at the optimum. The structured solver follows the
//! dual's central path in its own variables (`path`); clarabel gets it as a conic program
//! (`moment_program`).

use super::Objective;
use super::basis::{Affine, change};
use super::objective::{Function, Matrix, Measure};
use super::spectral::Spectral;
use super::structure::{Pattern, Structure};
use super::unsolved::ProgramError;
use nalgebra::{DMatrix, DVector};
use sublevel_core::body::Solver;
use sublevel_core::polynomial::NormPower;

/// Degree from which the structured solver is more than twice as fast as clarabel.
const STRUCTURED_DEGREE: usize = 8;

/// A dual point: weights, functional on the Hessian form, and the moments they give.
#[derive(Clone, Debug)]
pub(super) struct Dual {
    /// One weight per point of the program.
    pub(super) weights: DVector<f64>,
    /// Functional s on the Hessian form.
    pub(super) form: DVector<f64>,
    /// Moments m.
    pub(super) moments: DVector<f64>,
}

/// One fit's program but for its points.
#[derive(Clone, Debug)]
pub(super) struct Problem<'a> {
    pub(super) structure: &'a Structure,
    /// Which Gram matrix the objective measures.
    pub(super) matrix: Matrix,
    /// What it measures of it.
    pub(super) spectral: Spectral,
    /// ε; 0 when H is measured.
    pub(super) margin: f64,
    /// h: coefficients of the Hessian form of what relaxes convexity; none if nothing does.
    pub(super) allowance: Option<DVector<f64>>,
    /// What is to solve it; none for the faster one, and the other if that fails.
    pub(super) solver: Option<Solver>,
}

impl<'a> Problem<'a> {
    /// The program of an objective; `unit` maps the whitened frame to the unit frame, in which
    /// traces are measured.
    pub(super) fn new(structure: &'a Structure, objective: Objective, unit: &Affine, margin: f64) -> Self {
        let matrix = objective.matrix();
        let spectral = match objective.function() {
            Function::LogDet => Spectral::log_det(),
            Function::TraceInverse => Spectral::trace_inverse(change(structure, matrix, unit)),
        };
        let margin = match matrix {
            Matrix::Polynomial => margin,
            Matrix::Hessian => 0.0,
        };
        Self { structure, matrix, spectral, margin, allowance: None, solver: None }
    }

    /// The same program with convexity asked of `p + power` only.
    pub(super) fn relaxed(mut self, power: Option<&NormPower>) -> Self {
        self.allowance = power.map(|power| {
            let mut coefficients = DVector::zeros(self.structure.monomials.len());
            for (value, monomial) in coefficients.iter_mut().zip(&self.structure.monomials) {
                *value = power.terms().iter().find(|term| term.0 == *monomial).map_or(0.0, |term| term.1);
            }
            self.structure.derivative_matrix() * coefficients
        });
        self
    }

    /// The same program for one solver.
    pub(super) fn solved_by(self, solver: Option<Solver>) -> Self {
        Self { solver, ..self }
    }

    /// The solvers to try, in this order.
    pub(super) fn solvers(&self) -> Vec<Solver> {
        let is_log_det_p = self.is_log_det_p();
        match self.solver.or_else(|| under_test().filter(|_| is_log_det_p)) {
            Some(solver) => vec![solver],
            None if !is_log_det_p => vec![Solver::Clarabel],
            None if self.structure.degree >= STRUCTURED_DEGREE => vec![Solver::Structured, Solver::Clarabel],
            None => vec![Solver::Clarabel, Solver::Structured],
        }
    }

    /// Whether one solver was asked for where there are two.
    pub(super) fn is_solver_fixed(&self) -> bool {
        self.solver.is_some() && self.is_log_det_p()
    }

    fn is_log_det_p(&self) -> bool {
        self.matrix == Matrix::Polynomial && self.spectral.function() == Function::LogDet
    }

    /// Whether every mixture of points satisfies what the points do, as p is convex.
    pub(super) fn is_convex(&self) -> bool {
        self.allowance.is_none() && self.structure.hessian.size > 0
    }

    /// The pattern of the measured matrix.
    pub(super) fn pattern(&self) -> &'a Pattern {
        match self.matrix {
            Matrix::Polynomial => &self.structure.gram,
            Matrix::Hessian => &self.structure.hessian,
        }
    }

    /// Moment matrix of the measured matrix.
    pub(super) fn measured(&self, moments: &DVector<f64>, form: &DVector<f64>) -> DMatrix<f64> {
        self.pattern().spread(match self.matrix {
            Matrix::Polynomial => moments,
            Matrix::Hessian => form,
        })
    }

    /// `h·s - ε tr S` as a functional of s: what the form adds to the linear part of the dual
    /// objective.
    pub(super) fn form_cost(&self) -> DVector<f64> {
        let cost = self.structure.hessian.trace_form() * -self.margin;
        self.allowance.as_ref().map_or_else(|| cost.clone(), |allowance| &cost + allowance)
    }

    /// The dual objective: a lower bound of f over all feasible polynomials.
    pub(super) fn lower_bound(&self, dual: &Dual) -> Result<f64, ProgramError> {
        let bound = self.spectral.bound(&self.measured(&dual.moments, &dual.form)).ok_or(ProgramError::Singular)?;
        Ok(bound - dual.weights.sum() - self.form_cost().dot(&dual.form))
    }
}

/// The solver that unit tests take where they leave the choice open and there is one
/// (`make solvers`).
#[cfg(test)]
fn under_test() -> Option<Solver> {
    sublevel_testkit::solver_under_test()
}

#[cfg(not(test))]
const fn under_test() -> Option<Solver> {
    None
}
