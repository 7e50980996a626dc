//! The central path of a fit's dual program, followed by Newton's method.
//!
//! The dual of `program` has few variables, and its barrier problem, here for the Gram matrix P,
//!
//! ```text
//! minimise  τ (-φ(M(m)) + Σwᵢ - ε tr S(s)) - Σ log wᵢ - log det S(s),   m = Σ wᵢ v(xᵢ) - D*s
//! ```
//!
//! costs one small dense factorization per Newton step (Nesterov and Nemirovskii, Interior-Point Polynomial Algorithms,
//! 1994): milliseconds where a quadratic program of the same size takes a second. A centre is within (points + rows of
//! S)/τ of the optimum, and a Newton step near it yields a polynomial that satisfies all constraints strictly.
//!
//! Fits only start from it, because their last digits come from the solver; refinement needs few digits and a definite
//! Gram matrix, and takes the polynomial.

use super::model::Model;
use super::objective::Matrix;
use super::program::{Dual, Problem, regularised_factor};
use super::spectral::{Spectral, symmetric};
use super::structure::Structure;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Growth of τ from one centre to the next.
const GROWTH: f64 = 6.0;
/// Newton steps in all before settling for what there is.
const STEPS: usize = 120;

/// What the path minimises, besides `Σw - ε tr S`.
#[derive(Clone, Copy)]
pub(super) enum Goal<'a> {
    /// `-φ` of the moment matrix of one Gram matrix.
    Gram(Matrix, &'a Spectral),
    /// A quadratic function of the moments.
    Model(&'a Model),
}

/// A polynomial that satisfies every constraint of the program strictly.
#[derive(Clone, Debug)]
pub(super) struct Interior {
    /// Its coefficients.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form, `≻ εI`.
    pub(super) hessian: DMatrix<f64>,
}

/// Where a path ends.
pub(super) struct NearOptimum {
    /// The dual point.
    pub(super) dual: Dual,
    /// Coefficients of the polynomial that goes with it.
    pub(super) coefficients: DVector<f64>,
}

/// A point within about `gap` (of scaled f) of the optimum for the points whose monomials are the columns of `values` unless
/// definiteness was lost to rounding before; `None` if it was from the beginning.
pub(super) fn near_optimum(problem: &Problem, values: &DMatrix<f64>, gap: f64) -> Option<NearOptimum> {
    let goal = Goal::Gram(problem.matrix, &problem.spectral);
    let path = Path::new(problem.structure, values, problem.margin, goal);
    let mut dual = path.start()?;
    let mut tau = 1.0;
    for _ in 0..STEPS {
        let Some(newton) = path.step(&dual, tau) else { break };
        dual = newton.next;
        if newton.decrement < 1.0 {
            if path.barrier_parameter() / tau <= gap {
                break;
            }
            tau *= GROWTH;
        }
    }
    let coefficients = path.of_moments(&dual, tau)?.0 / tau;
    Some(NearOptimum { dual, coefficients })
}

/// The start of every path: weights that add up to the rows of P, and a functional to match.
pub(super) fn start(structure: &Structure, values: &DMatrix<f64>) -> Option<Dual> {
    Path::new(structure, values, 0.0, Goal::Gram(Matrix::Polynomial, &Spectral::log_det())).start()
}

/// The barrier problem.
pub(super) struct Path<'a> {
    structure: &'a Structure,
    values: &'a DMatrix<f64>,
    margin: f64,
    goal: Goal<'a>,
    /// D: Hessian forms x monomials.
    derivative: DMatrix<f64>,
    /// `tr S` as a functional of s.
    trace: DVector<f64>,
    /// `-log det` of the matrix that the goal does not measure.
    barrier: Spectral,
}

/// A damped Newton step.
pub(super) struct Newton {
    /// Where it leads.
    pub(super) next: Dual,
    /// Newton decrement before it.
    pub(super) decrement: f64,
    /// τ times the coefficients of p that the full step predicts.
    coefficients: DVector<f64>,
    /// The full step in s.
    form: DVector<f64>,
}

impl<'a> Path<'a> {
    pub(super) fn new(structure: &'a Structure, values: &'a DMatrix<f64>, margin: f64, goal: Goal<'a>) -> Self {
        let forms = structure.hessian.keys;
        let mut trace = DVector::zeros(forms);
        for i in 0..structure.hessian.size {
            trace[structure.hessian.key(i, i)] += 1.0;
        }
        let derivative = structure.derivative_matrix();
        Self { structure, values, margin, goal, derivative, trace, barrier: Spectral::log_det() }
    }

    /// At a centre, this over τ is the distance to the optimum.
    pub(super) fn barrier_parameter(&self) -> f64 {
        let cone = match self.goal {
            Goal::Gram(Matrix::Hessian, _) => &self.structure.gram,
            _ => &self.structure.hessian,
        };
        (self.values.ncols() + cone.size) as f64
    }

    fn point(&self, weights: DVector<f64>, form: DVector<f64>) -> Dual {
        Dual { moments: self.values * &weights - self.structure.pull_back(&form), weights, form }
    }

    /// Equal weights, and y isotropic and independent of z: S is positive definite, and small enough to leave M so.
    pub(super) fn start(&self) -> Option<Dual> {
        let points = self.values.ncols();
        let weights = DVector::repeat(points, self.structure.gram.size as f64 / points as f64);
        let isotropic = isotropic_form(self.structure, &(self.values * DVector::repeat(points, 1.0 / points as f64)));
        (0..40).find_map(|halvings| {
            let point = self.point(weights.clone(), &isotropic * 0.5_f64.powi(halvings));
            self.barrier.bound(&self.structure.gram.spread(&point.moments))?;
            Some(self.point(weights.clone(), &isotropic * 0.5_f64.powi(halvings + 1)))
        })
    }

    /// Objective of the barrier problem; none outside its domain.
    fn objective(&self, point: &Dual, tau: f64) -> Option<f64> {
        if point.weights.min() <= 0.0 {
            return None;
        }
        let form = self.structure.hessian.spread(&point.form);
        let moments = || self.structure.gram.spread(&point.moments);
        let value = match self.goal {
            Goal::Gram(Matrix::Polynomial, spectral) => {
                -tau * spectral.bound(&moments())? - self.barrier.bound(&form)?
            }
            Goal::Gram(Matrix::Hessian, spectral) => -tau * spectral.bound(&form)? - self.barrier.bound(&moments())?,
            Goal::Model(model) => tau * model.value(&point.moments) - self.barrier.bound(&form)?,
        };
        let weights = point.weights.iter().map(|w| w.ln()).sum::<f64>();
        let cost = point.weights.sum() - self.margin * self.trace.dot(&point.form);
        let value = value + tau * cost - weights;
        value.is_finite().then_some(value)
    }

    /// Minus the gradient, and the inverse of the Hessian, of the part that depends on m.
    fn of_moments(&self, at: &Dual, tau: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (spectral, scale) = match self.goal {
            Goal::Model(model) => {
                return Some((model.coefficients(&at.moments) * tau, model.flexibility() / tau));
            }
            Goal::Gram(Matrix::Polynomial, spectral) => (spectral, tau),
            Goal::Gram(Matrix::Hessian, _) => (&self.barrier, 1.0),
        };
        let matrix = self.structure.gram.spread(&at.moments);
        let gradient = self.structure.gram.collapse(&spectral.minimiser(&matrix)?);
        let factor = regularised_factor(&spectral.curvature(&self.structure.gram, &matrix)?)?;
        let root = factor.solve_lower_triangular(&DMatrix::identity(gradient.len(), gradient.len()))?;
        Some((gradient * scale, root.tr_mul(&root) / scale))
    }

    /// Minus the gradient, and the lower Cholesky factor of the Hessian, of the part that depends on s alone.
    fn of_form(&self, at: &Dual, tau: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (spectral, scale) = match self.goal {
            Goal::Gram(Matrix::Hessian, spectral) => (spectral, tau),
            _ => (&self.barrier, 1.0),
        };
        let matrix = self.structure.hessian.spread(&at.form);
        let gradient = self.structure.hessian.collapse(&spectral.minimiser(&matrix)?);
        let factor = regularised_factor(&spectral.curvature(&self.structure.hessian, &matrix)?)?;
        Some((gradient * scale, factor * scale.sqrt()))
    }

    /// A damped Newton step; none when rounding stands in its way.
    pub(super) fn step(&self, at: &Dual, tau: f64) -> Option<Newton> {
        let Self { values, derivative, .. } = self;
        // 1. Gradients and Hessians of the three parts.
        let (coefficients, flexibility) = self.of_moments(at, tau)?;
        let (gram, form_factor) = self.of_form(at, tau)?;
        let of_weights = (values.tr_mul(&coefficients) * -1.0).add_scalar(tau) - at.weights.map(|w| 1.0 / w);
        let of_form = derivative * &coefficients - &self.trace * (self.margin * tau) - gram;
        // 2. All but the part of m is block diagonal; that has the rank of the moments (Woodbury).
        let half = form_factor.solve_lower_triangular(derivative)?;
        let half_gradient = form_factor.solve_lower_triangular(&of_form)?;
        let scaled = DMatrix::from_fn(values.nrows(), values.ncols(), |i, j| values[(i, j)] * at.weights[j]);
        let squares = at.weights.component_mul(&at.weights);
        let plain = *values * squares.component_mul(&of_weights) - half.tr_mul(&half_gradient);
        let multiplier = Cholesky::new(flexibility + &scaled * scaled.transpose() + half.tr_mul(&half))?.solve(&plain);
        let step_weights = -squares.component_mul(&(&of_weights - values.tr_mul(&multiplier)));
        let step_form = -form_factor.tr_solve_lower_triangular(&(half_gradient + &half * &multiplier))?;
        let slope = of_weights.dot(&step_weights) + of_form.dot(&step_form);
        if slope.is_nan() || slope > 0.0 {
            return None;
        }
        // 3. Shortened until everything stays positive and the objective falls.
        let here = self.objective(at, tau)?;
        let next = (0..40).find_map(|shortening| {
            let length = 0.7_f64.powi(shortening);
            let next = self.point(&at.weights + &step_weights * length, &at.form + &step_form * length);
            let sufficient = here + 0.1 * length * slope + 1e-9 * here.abs();
            self.objective(&next, tau).is_some_and(|value| value <= sufficient).then_some(next)
        })?;
        // The multiplier is minus the Hessian of the part of m times the full step.
        Some(Newton { next, decrement: (-slope).sqrt(), coefficients: coefficients + multiplier, form: step_form })
    }

    /// The polynomial that a Newton step from `at` predicts, when the goal is a model.
    ///
    /// With decrement below 1 the step in w keeps `dw < w`, so that `1 - p(xᵢ) = (1 - dwᵢ/wᵢ)/(τwᵢ) > 0`, and
    /// `H = εI + (S⁻¹ - S⁻¹ dS S⁻¹)/τ ≻ εI` matches p exactly: both are the Newton equations read again.
    pub(super) fn interior(&self, at: &Dual, newton: &Newton, tau: f64) -> Option<Interior> {
        let pattern = &self.structure.hessian;
        let inverse = self.barrier.minimiser(&pattern.spread(&at.form))?;
        let size = pattern.size;
        let hessian = (&inverse - &inverse * pattern.spread(&newton.form) * &inverse) / tau
            + DMatrix::identity(size, size) * self.margin;
        Some(Interior { coefficients: &newton.coefficients / tau, hessian: symmetric(hessian) })
    }
}

/// The functional `y_i y_j z^e -> [i = j] mean(z^e)`.
fn isotropic_form(structure: &Structure, mean: &DVector<f64>) -> DVector<f64> {
    let size = structure.hessian.size / 3;
    let basis = &structure.hessian_basis;
    let position = |exponents: [u8; 3]| structure.monomials.iter().position(|&m| m == exponents);
    let mut form = DVector::zeros(structure.hessian.keys);
    for direction in 0..3 {
        for a in direction * size..(direction + 1) * size {
            for b in direction * size..(direction + 1) * size {
                let exponents = std::array::from_fn(|i| basis[a].exponents[i] + basis[b].exponents[i]);
                if let Some(index) = position(exponents) {
                    form[structure.hessian.key(a, b)] = mean[index];
                }
            }
        }
    }
    form
}
