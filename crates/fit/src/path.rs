//! The central path of a fit's dual program, followed by Newton's method.
//!
//! The dual of `program` has few variables, and its barrier problem, here for log det P,
//!
//! ```text
//! minimise  τ (-log det M(m) + Σwᵢ - ε tr S(s) + h·s) - Σ log wᵢ - log det S(s),   m = Σ wᵢ v(xᵢ) - D*s
//! ```
//!
//! costs one small dense factorization per Newton step (Nesterov and Nemirovskii, Interior-Point
//! Polynomial Algorithms, 1994). A centre is within (points + rows of S)/τ of the optimum, and a
//! Newton step near it yields a polynomial that satisfies all constraints strictly, with its Gram
//! matrices: an upper bound to compare with the lower bound of the dual.

use super::FitError;
use super::barrier::Barrier;
use super::factor::{cholesky, regularised_factor, solve_lower};
use super::model::Model;
use super::program::{Dual, Problem};
use super::progress::Watch;
use super::structure::{Structure, interior_form};
use nalgebra::{Cholesky, DMatrix, DVector};

/// Newton decrement below which a point counts as a centre; 1 is where its polynomial stops being
/// feasible.
const CENTRED: f64 = 0.9;

/// Growth of τ below which a path that rounding blocks is given up.
const LEAST_GROWTH: f64 = 1.3;

/// What the path minimises, besides `Σw - ε tr S + h·s`.
#[derive(Clone, Copy)]
pub(super) enum PathObjective<'a> {
    /// `-log det` of the moment matrix of P.
    LogDet,
    /// A quadratic function of the moments.
    Model(&'a Model),
}

/// A polynomial that satisfies every constraint of the program strictly.
#[derive(Clone, Debug)]
pub(super) struct Interior {
    /// Its coefficients.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form: `≻ εI` but for rounding, of which it may lose half.
    pub(super) hessian: DMatrix<f64>,
}

/// A dual point and the weight of the objective there.
#[derive(Clone, Debug)]
pub(super) struct DualPoint {
    pub(super) dual: Dual,
    pub(super) tau: f64,
}

/// How to follow a path.
#[derive(Clone, Copy, Debug)]
pub(super) struct PathOptions {
    /// Distance to the optimum at which to stop, in units of the objective.
    pub(super) gap: f64,
    /// Growth of τ from one centre to the next.
    pub(super) growth: f64,
    /// Newton steps at most.
    pub(super) steps: usize,
}

/// A point near the path.
#[derive(Clone, Debug)]
pub(super) struct Iterate {
    /// Where it is.
    pub(super) point: DualPoint,
    /// The polynomial that belongs to it.
    pub(super) interior: Interior,
    /// The Gram matrix P of that polynomial; none if the objective is a model, where p needs none.
    pub(super) gram: Option<DMatrix<f64>>,
}

/// The barrier problem.
pub(super) struct Path<'a> {
    structure: &'a Structure,
    values: &'a DMatrix<f64>,
    margin: f64,
    objective: PathObjective<'a>,
    /// D: Hessian forms x monomials.
    derivative: DMatrix<f64>,
    /// h: deficit of convexity that is allowed to the Hessian form of p.
    allowance: DVector<f64>,
    /// `h·s - ε tr S` as a functional of s.
    cost: DVector<f64>,
}

/// A damped Newton step.
struct Newton {
    /// Where it leads.
    next: Dual,
    /// Where it would lead undamped.
    whole: Dual,
    /// Newton decrement before it.
    decrement: f64,
    /// τ times the coefficients of p that the full step predicts.
    coefficients: DVector<f64>,
}

impl<'a> Path<'a> {
    /// The path of a fit over the points whose monomials are the columns of `values`.
    pub(super) fn of_fit(problem: &'a Problem, values: &'a DMatrix<f64>) -> Self {
        let path = Self::new(problem.structure, values, problem.margin, PathObjective::LogDet);
        let allowance = problem.allowance.clone().unwrap_or_else(|| path.allowance.clone());
        Self { allowance, cost: problem.form_cost(), ..path }
    }

    pub(super) fn new(
        structure: &'a Structure,
        values: &'a DMatrix<f64>,
        margin: f64,
        objective: PathObjective<'a>,
    ) -> Self {
        let forms = structure.hessian.keys;
        let cost = structure.hessian.trace_form() * -margin;
        let derivative = structure.derivative_matrix();
        Self { structure, values, margin, objective, derivative, allowance: DVector::zeros(forms), cost }
    }

    /// `-τ log det M`.
    fn of_gram(&self, tau: f64) -> Barrier<'a> {
        Barrier { pattern: &self.structure.gram, weight: tau }
    }

    /// `-log det S`.
    fn of_form(&self) -> Barrier<'a> {
        Barrier { pattern: &self.structure.hessian, weight: 1.0 }
    }

    /// At a centre, this over τ is the distance to the optimum.
    pub(super) fn barrier_parameter(&self) -> f64 {
        (self.values.ncols() + self.structure.hessian.size) as f64
    }

    fn point(&self, weights: DVector<f64>, form: DVector<f64>) -> Dual {
        Dual { moments: self.values * &weights - self.structure.pull_back(&form), weights, form }
    }

    /// Equal weights that add up to the rows of P, and a functional that leaves M definite.
    pub(super) fn start(&self) -> Option<DualPoint> {
        let points = self.values.ncols();
        let rows = self.structure.gram.size as f64;
        let weights = DVector::repeat(points, rows / points as f64);
        let mean = self.values * DVector::repeat(points, 1.0 / points as f64);
        let dual = self.point(weights, interior_form(self.structure, &mean, rows)?);
        // At a centre the rows of S are what relaxed convexity costs: a start that costs more is
        // far from any.
        let least = self.structure.hessian.size as f64 / self.cost.dot(&dual.form);
        let share = if least > 0.0 { least.min(1.0) } else { 1.0 };
        Some(DualPoint { dual: self.point(dual.weights, dual.form * share), tau: 1.0 })
    }

    /// The last centre before the steps ran out or rounding stood in the way; its τ bounds how far
    /// that is from the optimum.
    ///
    /// # Errors
    /// [`FitError::Cancelled`].
    pub(super) fn follow(
        &self,
        from: DualPoint,
        options: PathOptions,
        watch: &mut Watch,
    ) -> Result<Option<Iterate>, FitError> {
        let DualPoint { mut dual, mut tau } = from;
        let mut growth = options.growth;
        let mut last: Option<Iterate> = None;
        for _ in 0..options.steps {
            watch.iteration(self.barrier_parameter() / tau)?;
            let newton = self.step(&dual, tau);
            let centred = newton.as_ref().is_some_and(|newton| newton.decrement < CENTRED);
            let centre = newton.as_ref().filter(|_| centred).and_then(|newton| self.centre(&dual, newton, tau));
            match (newton, centre) {
                (Some(_), Some(centre)) => {
                    dual.clone_from(&centre.point.dual);
                    last = Some(centre);
                    let end = self.barrier_parameter() / options.gap;
                    if tau >= end {
                        break;
                    }
                    tau = (tau * growth).min(end);
                }
                (Some(newton), None) if !centred => dual = newton.next,
                // Rounding: from the last centre a shorter step may still be possible.
                _ => {
                    growth = growth.sqrt();
                    let Some(Iterate { point, .. }) = last.as_ref().filter(|_| growth > LEAST_GROWTH) else { break };
                    (dual, tau) = (point.dual.clone(), point.tau * growth);
                }
            }
        }
        Ok(last)
    }

    /// Objective of the barrier problem; none outside its domain.
    fn objective(&self, point: &Dual, tau: f64) -> Option<f64> {
        if point.weights.min() <= 0.0 {
            return None;
        }
        let of_moments = match self.objective {
            PathObjective::Model(model) => tau * model.value(&point.moments),
            PathObjective::LogDet => self.of_gram(tau).value(&point.moments)?,
        };
        let of_form = self.of_form().value(&point.form)?;
        let weights = point.weights.iter().map(|w| w.ln()).sum::<f64>();
        let cost = point.weights.sum() + self.cost.dot(&point.form);
        let value = of_moments + of_form + tau * cost - weights;
        value.is_finite().then_some(value)
    }

    /// Minus the gradient, and the inverse of the Hessian, of the part that depends on m.
    fn of_moments(&self, at: &Dual, tau: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
        if let PathObjective::Model(model) = self.objective {
            return Some((model.coefficients(&at.moments) * tau, model.flexibility() / tau));
        }
        let (gradient, curvature) = self.of_gram(tau).derivatives(&at.moments)?;
        let factor = regularised_factor(&curvature)?;
        let root = solve_lower(&factor, DMatrix::identity(gradient.len(), gradient.len()))?;
        Some((gradient, root.transpose() * &root))
    }

    /// A damped Newton step; none when rounding stands in its way.
    fn step(&self, at: &Dual, tau: f64) -> Option<Newton> {
        let Self { values, derivative, .. } = self;
        // 1. Gradients and Hessians of the three parts.
        let (coefficients, flexibility) = self.of_moments(at, tau)?;
        let (gram, curvature) = self.of_form().derivatives(&at.form)?;
        let form_factor = regularised_factor(&curvature)?;
        let of_weights = (values.tr_mul(&coefficients) * -1.0).add_scalar(tau) - at.weights.map(|w| 1.0 / w);
        let of_form = derivative * &coefficients + &self.cost * tau - gram;
        // 2. All but the part of m is block diagonal; that has the rank of the moments (Woodbury).
        let half = solve_lower(&form_factor, derivative.clone())?;
        let half_gradient = form_factor.solve_lower_triangular(&of_form)?;
        let scaled = DMatrix::from_fn(values.nrows(), values.ncols(), |i, j| values[(i, j)] * at.weights[j]);
        let squares = at.weights.component_mul(&at.weights);
        let plain = *values * squares.component_mul(&of_weights) - half.tr_mul(&half_gradient);
        let system = flexibility + &scaled * scaled.transpose() + half.transpose() * &half;
        let factor = cholesky(system)?;
        let mut multiplier = factor.solve_lower_triangular(&plain)?;
        factor.tr_solve_lower_triangular_mut(&mut multiplier);
        let step_weights = -squares.component_mul(&(&of_weights - values.tr_mul(&multiplier)));
        let step_form = -form_factor.tr_solve_lower_triangular(&(half_gradient + &half * &multiplier))?;
        let slope = of_weights.dot(&step_weights) + of_form.dot(&step_form);
        if slope.is_nan() || slope > 0.0 {
            return None;
        }
        // 3. Shortened until everything stays positive and the objective falls.
        let along = |length: f64| self.point(&at.weights + &step_weights * length, &at.form + &step_form * length);
        let here = self.objective(at, tau)?;
        let next = (0..40).find_map(|shortening| {
            let length = 0.7_f64.powi(shortening);
            let next = along(length);
            let sufficient = here + 0.1 * length * slope + 1e-9 * here.abs();
            self.objective(&next, tau).is_some_and(|value| value <= sufficient).then_some(next)
        })?;
        // The multiplier is minus the Hessian of the part of m times the full step.
        Some(Newton { next, whole: along(1.0), decrement: (-slope).sqrt(), coefficients: coefficients + multiplier })
    }

    /// The polynomial that a Newton step from `at` predicts; none if it is infeasible because of
    /// rounding.
    ///
    /// With decrement below 1 the step in w keeps `dw < w`, so that
    /// `1 - p(xᵢ) = (1 - dwᵢ/wᵢ)/(τwᵢ) > 0`, and both Gram matrices, predicted from the gradients
    /// of their barriers, are definite and match p: these are the Newton equations read again.
    fn centre(&self, at: &Dual, newton: &Newton, tau: f64) -> Option<Iterate> {
        let coefficients = &newton.coefficients / tau;
        let Structure { gram, hessian, .. } = self.structure;
        let margin = DMatrix::identity(hessian.size, hessian.size) * self.margin;
        let form = self.of_form().predicted(&at.form, &newton.whole.form)? / tau + &margin;
        let form = hessian.nearest(&form, &(&self.derivative * &coefficients + &self.allowance));
        Cholesky::new(&form - margin * 0.5)?;
        let gram = match self.objective {
            PathObjective::Model(_) => None,
            PathObjective::LogDet => {
                let predicted = self.of_gram(tau).predicted(&at.moments, &newton.whole.moments)?;
                Some(gram.nearest(&(predicted / tau), &coefficients))
            }
        };
        let point = DualPoint { dual: newton.next.clone(), tau };
        Some(Iterate { point, interior: Interior { coefficients, hessian: form }, gram })
    }
}
