//! A start close to the optimum: a few Newton steps along the central path of the dual program.
//!
//! The dual of `program` has few variables, and its barrier problem
//!
//! ```text
//! minimise  τ (-log det M(m) + Σwᵢ - ε tr S(s)) - Σ log wᵢ - log det S(s),   m = Σ wᵢ v(xᵢ) - D*s
//! ```
//!
//! costs one small dense factorization per Newton step (Nesterov and Nemirovskii, Interior-Point Polynomial Algorithms,
//! 1994): milliseconds where a quadratic program of the same size takes a second. What it gives is only a start:
//! accuracy and multipliers come from the solver.

use super::program::{Dual, log_det, regularised_factor};
use super::structure::Structure;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Growth of τ from one centre to the next.
const GROWTH: f64 = 6.0;
/// Newton steps in all before settling for what there is.
const STEPS: usize = 120;

/// A dual point, within about `gap` (in -log det) of the optimum for the points whose monomials are the columns of `values` unless
/// definiteness was lost to rounding before; `None` if it was from the beginning.
pub(super) fn near_optimum(structure: &Structure, values: &DMatrix<f64>, margin: f64, gap: f64) -> Option<Dual> {
    let path = Path::new(structure, values, margin);
    let mut point = path.start()?;
    let barrier_parameter = (values.ncols() + structure.hessian.size) as f64;
    let mut tau = 1.0;
    for _ in 0..STEPS {
        let Some((next, decrement)) = path.step(&point, tau) else { break };
        point = next;
        if decrement < 1.0 {
            if barrier_parameter / tau <= gap {
                break;
            }
            tau *= GROWTH;
        }
    }
    Some(point)
}

/// The barrier problem.
struct Path<'a> {
    structure: &'a Structure,
    values: &'a DMatrix<f64>,
    margin: f64,
    /// D: Hessian forms x monomials.
    derivative: DMatrix<f64>,
    /// `tr S` as a functional of s.
    trace: DVector<f64>,
}

impl<'a> Path<'a> {
    fn new(structure: &'a Structure, values: &'a DMatrix<f64>, margin: f64) -> Self {
        let forms = structure.hessian.keys;
        let mut derivative = DMatrix::zeros(forms, structure.monomials.len());
        for (row, &(monomial, factor)) in structure.derivative.iter().enumerate() {
            derivative[(row, monomial)] = factor;
        }
        let mut trace = DVector::zeros(forms);
        for i in 0..structure.hessian.size {
            trace[structure.hessian.key(i, i)] += 1.0;
        }
        Self { structure, values, margin, derivative, trace }
    }

    fn point(&self, weights: DVector<f64>, form: DVector<f64>) -> Dual {
        Dual { moments: self.values * &weights - self.structure.pull_back(&form), weights, form }
    }

    /// Equal weights, and y isotropic and independent of z: S is positive definite, and small enough to leave M so.
    fn start(&self) -> Option<Dual> {
        let points = self.values.ncols();
        let weights = DVector::repeat(points, self.structure.gram.size as f64 / points as f64);
        let isotropic = isotropic_form(self.structure, &(self.values * DVector::repeat(points, 1.0 / points as f64)));
        (0..40).find_map(|halvings| {
            let point = self.point(weights.clone(), &isotropic * 0.5_f64.powi(halvings));
            log_det(&self.structure.gram.spread(&point.moments))?;
            Some(self.point(weights.clone(), &isotropic * 0.5_f64.powi(halvings + 1)))
        })
    }

    /// Objective of the barrier problem; none outside its domain.
    fn objective(&self, point: &Dual, tau: f64) -> Option<f64> {
        if point.weights.min() <= 0.0 {
            return None;
        }
        let moments = log_det(&self.structure.gram.spread(&point.moments))?;
        let form = log_det(&self.structure.hessian.spread(&point.form))?;
        let weights = point.weights.iter().map(|w| w.ln()).sum::<f64>();
        let value = tau * (point.weights.sum() - moments - self.margin * self.trace.dot(&point.form)) - weights - form;
        value.is_finite().then_some(value)
    }

    /// A damped Newton step and the decrement before it; none when rounding stands in its way.
    fn step(&self, at: &Dual, tau: f64) -> Option<(Dual, f64)> {
        let Self { structure, values, derivative, .. } = self;
        // 1. Gradients and Hessians of the three logarithms.
        let gram = Cholesky::new(structure.gram.spread(&at.moments))?.inverse();
        let coefficients = structure.gram.collapse(&gram);
        let functional = Cholesky::new(structure.hessian.spread(&at.form))?.inverse();
        let of_weights = (values.tr_mul(&coefficients) * -1.0).add_scalar(1.0) * tau - at.weights.map(|w| 1.0 / w);
        let of_form =
            (derivative * &coefficients - &self.trace * self.margin) * tau - structure.hessian.collapse(&functional);
        let form_factor = regularised_factor(&structure.hessian.congruence(&functional))?;
        let moment_factor = regularised_factor(&structure.gram.congruence(&gram))?;
        // 2. All but τ log det M is block diagonal; that term has the rank of the moments (Woodbury).
        let half = form_factor.solve_lower_triangular(derivative)?;
        let half_gradient = form_factor.solve_lower_triangular(&of_form)?;
        let scaled = DMatrix::from_fn(values.nrows(), values.ncols(), |i, j| values[(i, j)] * at.weights[j]);
        let identity = DMatrix::identity(values.nrows(), values.nrows());
        let root = moment_factor.solve_lower_triangular(&identity)?;
        let flexibility = root.tr_mul(&root) / tau;
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
        Some((next, (-slope).sqrt()))
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
