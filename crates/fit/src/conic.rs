//! The convex quadratic program over one of the smaller cones, by a primal-dual interior-point
//! method.
//!
//! ```text
//! minimise  F(c)   subject to  p(xᵢ) + tᵢ = 1,  tᵢ >= 0,
//!                              D c - ε tr = A x,  every block of x in its Lorentz cone
//! ```
//!
//! over the coefficients c of p, F a quadratic model (`model`), A and the blocks those of
//! `dominance`. With multipliers λ >= 0 of the points and a functional s on the form, optimality is
//!
//! ```text
//! ∇F + V λ - D* s = 0,   λᵢ tᵢ = 0,   z = A* s in the cones,  x·z = 0 block by block.
//! ```
//!
//! Newton's method with the scaling of Nesterov and Todd and Mehrotra's corrector; dx = … - Θ A*
//! ds, so that all that is left of a step is one system with the Hessian `B + V diag(λ/t) V* + D*
//! (A Θ A*)⁻¹ D` in as many variables as p has coefficients.

use super::FitError;
use super::dominance::{Bordered, Dominance};
use super::factor::regularised_factor;
use super::lorentz::{Scaling, longest, product, quotient};
use super::model::Model;
use super::path::Interior;
use super::progress::Watch;
use nalgebra::{DMatrix, DVector, Vector3};

/// Steps at most; 10 to 25 are usual.
const MAX_CONIC_STEPS: usize = 60;
/// Largest part of the way to the boundary that a step takes.
const CONIC_STEP_SHARE: f64 = 0.98;
/// Error of the equations at which to stop, relative to the largest block.
const FEASIBILITY_ERROR: f64 = 1e-9;

/// The same of what is taken when there is no better.
const ROUGH_FEASIBILITY_ERROR: f64 = 1e-6;

/// Size of the functional to start from, beside the slope of the model.
const FUNCTIONAL: f64 = 0.5;
/// Least slack of a point to start from.
const LEAST_SLACK: f64 = 0.1;

/// One program.
pub(super) struct Conic<'a> {
    pub(super) dominance: &'a Dominance,
    /// Monomials of each point, one column each.
    pub(super) values: &'a DMatrix<f64>,
    /// ε.
    pub(super) margin: f64,
    pub(super) model: &'a Model,
}

/// Where the method is.
#[derive(Clone, Debug)]
struct Point {
    coefficients: DVector<f64>,
    slacks: DVector<f64>,
    multipliers: DVector<f64>,
    blocks: Vec<Vector3<f64>>,
    form: DVector<f64>,
    /// z = A* s.
    duals: Vec<Vector3<f64>>,
}

/// Residuals of the linear equations at a point.
struct Residuals {
    gradient: DVector<f64>,
    points: DVector<f64>,
    form: DVector<f64>,
}

impl Residuals {
    /// The largest error of what makes a point feasible, relative to its largest block.
    fn infeasibility(&self, at: &Point) -> f64 {
        let size = at.blocks.iter().map(|x| x.x).fold(1.0, f64::max);
        self.form.amax().max(self.points.amax()) / size
    }
}

/// What one factorization serves: predictor and corrector.
struct System<'a> {
    scalings: Vec<Scaling>,
    /// Duals in the scaled frames, where they equal the blocks.
    scaled: Vec<Vector3<f64>>,
    normal: Bordered<'a>,
    factor: DMatrix<f64>,
}

/// Aims of a step: `λ dt + t dλ` of each point, and the same of each block in its scaled frame.
struct Aims {
    points: DVector<f64>,
    blocks: Vec<Vector3<f64>>,
}

impl Conic<'_> {
    /// The minimiser, to an absolute `gap` in F; something feasible where rounding stands in the
    /// way, or none.
    ///
    /// # Errors
    /// [`FitError::Cancelled`].
    pub(super) fn minimise(
        &self,
        start: &DVector<f64>,
        gap: f64,
        watch: &mut Watch,
    ) -> Result<Option<Interior>, FitError> {
        let mut at = self.start(start, gap);
        for _ in 0..MAX_CONIC_STEPS {
            watch.iteration(at.gap())?;
            let residuals = self.residuals(&at);
            if residuals.infeasibility(&at) <= FEASIBILITY_ERROR && at.gap() <= gap && residuals.gradient.amax() <= gap
            {
                return Ok(Some(self.interior(at)));
            }
            let Some(next) = self.step(&at, &residuals) else { break };
            at = next;
        }
        // Feasible all the same, it may still be a way down.
        Ok((self.residuals(&at).infeasibility(&at) <= ROUGH_FEASIBILITY_ERROR).then(|| self.interior(at)))
    }

    /// Centred: every product of a slack and its multiplier is the same. Blocks as large as the
    /// form asks for, and a functional that is small beside the slope of the model, as it is at the
    /// minimum.
    fn start(&self, coefficients: &DVector<f64>, gap: f64) -> Point {
        let Self { dominance, values, model, .. } = self;
        let slope = dominance.pull_back(&dominance.positive).norm();
        let form = &dominance.positive * (FUNCTIONAL * model.gradient(coefficients).norm() / slope);
        let duals = dominance.spread(&form);
        let inverses: Vec<Vector3<f64>> = duals.iter().map(|z| quotient(&Vector3::x(), z)).collect();
        let trace = dominance.trace();
        let wanted = trace.dot(&dominance.form(coefficients)).max(1.0);
        let share = (wanted / trace.dot(&dominance.collapse(&inverses))).max(gap / duals.len() as f64);
        let slacks = values.tr_mul(coefficients).map(|value| (1.0 - value).max(LEAST_SLACK));
        Point {
            coefficients: coefficients.clone(),
            multipliers: slacks.map(|slack| share / slack),
            slacks,
            blocks: inverses.iter().map(|inverse| inverse * share).collect(),
            form,
            duals,
        }
    }

    fn residuals(&self, at: &Point) -> Residuals {
        let Self { dominance, values, model, .. } = self;
        let form = dominance.collapse(&at.blocks) + dominance.trace() * self.margin - dominance.form(&at.coefficients);
        Residuals {
            gradient: dominance.pull_back(&at.form) - model.gradient(&at.coefficients) - *values * &at.multipliers,
            points: (values.tr_mul(&at.coefficients) + &at.slacks).map(|sum| 1.0 - sum),
            form,
        }
    }

    /// A predictor, to see how far the aim can be set, and the step corrected for what the
    /// predictor neglects.
    fn step(&self, at: &Point, residuals: &Residuals) -> Option<Point> {
        let system = self.system(at)?;
        let plain = Aims {
            points: -at.slacks.component_mul(&at.multipliers),
            blocks: system.scaled.iter().map(|l| -product(l, l)).collect(),
        };
        let predictor = self.direction(&system, at, residuals, &plain);
        let reach = at.longest(&predictor).min(1.0);
        let mean = at.gap() / (at.slacks.len() + at.blocks.len()) as f64;
        let centre = (1.0 - reach).powi(3).clamp(1e-4, 0.8) * mean;
        let corrections = system.scalings.iter().zip(predictor.blocks.iter().zip(&predictor.duals));
        let corrections = corrections.map(|(w, (dx, dz))| product(&w.unapply(dx), &w.apply(dz)));
        let aims = Aims {
            points: (&plain.points - predictor.slacks.component_mul(&predictor.multipliers)).add_scalar(centre),
            blocks: plain.blocks.iter().zip(corrections).map(|(aim, by)| aim - by + Vector3::x() * centre).collect(),
        };
        let step = self.direction(&system, at, residuals, &aims);
        let length = (CONIC_STEP_SHARE * at.longest(&step)).min(1.0);
        let next = at.moved(&step, length);
        (length > 1e-8 && next.gap().is_finite()).then_some(next)
    }

    fn system(&self, at: &Point) -> Option<System<'_>> {
        let pairs = at.blocks.iter().zip(&at.duals);
        let scalings = pairs.map(|(x, z)| Scaling::new(x, z)).collect::<Option<Vec<_>>>()?;
        let scaled = scalings.iter().zip(&at.duals).map(|(w, z)| w.apply(z)).collect();
        let normal = self.dominance.normal(scalings.iter().map(Scaling::square))?;
        let weights = at.multipliers.component_div(&at.slacks);
        let mut weighted = self.values.clone();
        for (mut column, weight) in weighted.column_iter_mut().zip(weights.iter()) {
            column *= *weight;
        }
        let hessian = self.model.flexibility() + weighted * self.values.transpose() + normal.curvature()?;
        Some(System { scalings, scaled, normal, factor: regularised_factor(&hessian)? })
    }

    /// The Newton step towards the aims.
    fn direction(&self, system: &System, at: &Point, residuals: &Residuals, aims: &Aims) -> Point {
        let Self { dominance, values, .. } = self;
        // dx = toward - Θ dz,  dλ = (aim - λ dt)/t
        let toward: Vec<Vector3<f64>> = system
            .scalings
            .iter()
            .zip(system.scaled.iter().zip(&aims.blocks))
            .map(|(w, (l, aim))| w.apply(&quotient(aim, l)))
            .collect();
        let push = (&aims.points - at.multipliers.component_mul(&residuals.points)).component_div(&at.slacks);
        let form = &residuals.form + dominance.collapse(&toward);
        let mut change = &residuals.gradient - *values * &push + dominance.pull_back(&system.normal.solve(&form));
        system.factor.solve_lower_triangular_mut(&mut change);
        system.factor.tr_solve_lower_triangular_mut(&mut change);
        let functional = system.normal.solve(&(form - dominance.form(&change)));
        let duals = dominance.spread(&functional);
        let blocks = toward.iter().zip(system.scalings.iter().zip(&duals)).map(|(t, (w, dz))| t - w.square() * dz);
        let slacks = &residuals.points - values.tr_mul(&change);
        Point {
            multipliers: (&aims.points - at.multipliers.component_mul(&slacks)).component_div(&at.slacks),
            coefficients: change,
            slacks,
            blocks: blocks.collect(),
            form: functional,
            duals,
        }
    }

    /// The polynomial and its Gram matrix.
    fn interior(&self, at: Point) -> Interior {
        let hessian = self.dominance.gram(&at.blocks);
        let margin = DMatrix::identity(hessian.nrows(), hessian.nrows()) * self.margin;
        Interior { coefficients: at.coefficients, hessian: hessian + margin }
    }
}

impl Point {
    /// `Σ λ t + Σ x·z`: how far F is from its minimum once all equations hold.
    fn gap(&self) -> f64 {
        let blocks = self.blocks.iter().zip(&self.duals).map(|(x, z)| x.dot(z)).sum::<f64>();
        self.slacks.dot(&self.multipliers) + blocks
    }

    /// The longest step that leaves nothing negative.
    fn longest(&self, step: &Self) -> f64 {
        let of_ray = |(value, change): (&f64, &f64)| if *change < 0.0 { -value / change } else { f64::INFINITY };
        let of_cone = |(x, dx): (&Vector3<f64>, &Vector3<f64>)| longest(x, dx);
        let rays =
            self.slacks.iter().zip(step.slacks.iter()).chain(self.multipliers.iter().zip(step.multipliers.iter()));
        let cones = self.blocks.iter().zip(&step.blocks).chain(self.duals.iter().zip(&step.duals));
        rays.map(of_ray).chain(cones.map(of_cone)).fold(f64::INFINITY, f64::min)
    }

    fn moved(&self, step: &Self, length: f64) -> Self {
        let moved =
            |from: &[Vector3<f64>], by: &[Vector3<f64>]| from.iter().zip(by).map(|(x, dx)| x + dx * length).collect();
        Self {
            coefficients: &self.coefficients + &step.coefficients * length,
            slacks: &self.slacks + &step.slacks * length,
            multipliers: &self.multipliers + &step.multipliers * length,
            blocks: moved(&self.blocks, &step.blocks),
            form: &self.form + &step.form * length,
            duals: moved(&self.duals, &step.duals),
        }
    }
}
