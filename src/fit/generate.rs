//! Solves the program of a fit: damped Newton steps, adding the points that a step leaves outside.

use super::path::{NearOptimum, near_optimum, start};
use super::program::{Dual, Problem, ProgramError};
use super::quadratic::{Step, newton_step};
use super::structure::Structure;
use super::trace;
use super::{FitError, Progress};
use nalgebra::{DMatrix, DVector, Vector3};
use std::ops::ControlFlow;

/// A point may be outside by this much in p before the pull-in takes it in.
const VIOLATION: f64 = 1e-6;
/// As [`VIOLATION`], for points that the program takes into account and the solver leaves outside all the same.
const SLOPPY: f64 = 1e-4;
/// Newton decrement at which to stop; the objective is then within about its square.
const DECREMENT: f64 = 1e-3;
/// Largest distance of f to its lower bound, relative to f (or 1, if that is more), of a fit.
pub(super) const OPTIMALITY_GAP: f64 = 1e-5;
/// Accuracy asked of the solver for the last steps, its default.
pub(super) const FINE: f64 = 1e-8;
/// Accuracy asked of the solver while the steps are damped: they only have to lead downhill.
const COARSE: f64 = 1e-3;
/// Weight, as a part of all weights, below which a point of the start is left out of the program until it is violated.
const NEGLIGIBLE: f64 = 1e-4;
/// Gap of the start to the optimum, in units of -log det: below the square of [`DECREMENT`], so that mostly one
/// quadratic program is enough.
const GAP: f64 = 3e-7;
/// The same while points are still added to the start.
const ROUGH_GAP: f64 = 1e-3;
/// Most rounds of adding points to the start, and the violation below which it does not matter.
const PREPARATIONS: usize = 3;
/// See [`PREPARATIONS`].
const PREPARED: f64 = 1e-3;
/// Points in the start, in multiples of N.
const SPREAD: usize = 10;
/// Newton steps before giving up.
const ROUNDS: usize = 60;
/// Further Newton steps for an answer that looks final but whose gap is too large, before it is rejected.
const IMPROVEMENTS: usize = 4;

/// The optimum of a fit's program, feasible for all points up to [`VIOLATION`].
#[derive(Clone, Debug)]
pub(super) struct Optimum {
    /// Coefficients of p on `Structure::monomials`.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form.
    pub(super) hessian: DMatrix<f64>,
    /// f minus its lower bound from the dual; at most [`OPTIMALITY_GAP`] in proportion.
    pub(super) gap: f64,
    /// f, in the whitened frame for log dets and in the unit frame for traces.
    pub(super) objective: f64,
    /// The last quadratic program was solved to full accuracy.
    pub(super) full_accuracy: bool,
    /// Newton steps.
    pub(super) rounds: usize,
    /// Interior-point iterations in all.
    pub(super) iterations: u32,
}

/// Minimises the objective over sos-convex p with `p <= 1` at `points` (whitened: the unit ball is their smallest
/// ellipsoid).
pub(super) fn generate(
    problem: Problem,
    points: &[Vector3<f64>],
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Optimum, FitError> {
    let structure = problem.structure;
    let mut active = Active::start(structure, points);
    if !problem.spectral.is_self_concordant() {
        return linear(problem, points, active, progress);
    }
    let (mut dual, mut tolerance) = match prepared(&problem, points, &mut active, progress)? {
        Some(start) => (active.keep(&problem, start), FINE),
        None => (active.uniform(&problem), COARSE),
    };
    let mut iterations = 0;
    let mut rejected = 0;
    for round in 1..=ROUNDS {
        let step = newton_step(&problem, &active.values, &dual, tolerance)?;
        iterations += step.iterations;
        let outside = violations(structure, points, &step.coefficients);
        let worst = outside.first().map_or(0.0, |&(excess, _)| excess);
        let active_points = active.values.ncols();
        let report = Progress { round, active_points, worst_violation: worst, decrement: Some(step.decrement) };
        if progress(report).is_break() {
            return Err(FitError::Cancelled);
        }
        // Points that are in the program and still outside are the solver's accuracy, which the pull-in pays for.
        let fits = worst <= VIOLATION || worst <= SLOPPY && outside.iter().all(|&(_, index)| active.used[index]);
        if fits && tolerance <= FINE {
            // The gap decides; a step that is done by its own measure and has none is taken a few more times.
            let done = step.decrement <= DECREMENT;
            let bound = problem.lower_bound(&step.target).unwrap_or(f64::NEG_INFINITY);
            match verified(&step, bound, round, iterations) {
                Ok(optimum) => return Ok(optimum),
                Err(gap) if done && rejected == IMPROVEMENTS => return Err(FitError::NotOptimal { gap }),
                Err(_) => rejected += usize::from(done),
            }
        }
        // The next decrement is about the square of this one: more accuracy than that is wasted on it.
        tolerance = (1e-2 * step.decrement.powi(4)).clamp(FINE, COARSE);
        dual = problem.damped(&dual, &step.target);
        active.add(structure, points, &outside, &mut dual);
    }
    Err(FitError::NoConvergence { rounds: ROUNDS })
}

/// As [`generate`], where every round is one linear program: only points are left to add.
fn linear(
    mut problem: Problem,
    points: &[Vector3<f64>],
    mut active: Active,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Optimum, FitError> {
    let structure = problem.structure;
    let first = start(structure, &active.values).ok_or(ProgramError::Singular)?;
    // At the path's start the weights have the right sum, so the scale is a square.
    problem = sized(problem, &first, -2).ok_or(ProgramError::Singular)?;
    let mut iterations = 0;
    for round in 1..=ROUNDS {
        let (mut step, bound) = trace::solve(&problem, &active.values)?;
        iterations += step.iterations;
        let outside = violations(structure, points, &step.coefficients);
        let worst = outside.first().map_or(0.0, |&(excess, _)| excess);
        let report =
            Progress { round, active_points: active.values.ncols(), worst_violation: worst, decrement: Some(0.0) };
        if progress(report).is_break() {
            return Err(FitError::Cancelled);
        }
        if worst <= VIOLATION || worst <= SLOPPY && outside.iter().all(|&(_, index)| active.used[index]) {
            return verified(&step, bound, round, iterations).map_err(|gap| FitError::NotOptimal { gap });
        }
        active.add(structure, points, &outside, &mut step.target);
    }
    Err(FitError::NoConvergence { rounds: ROUNDS })
}

/// The optimum if the dual solution proves it one, whatever the solver says of it; else the gap that is left.
fn verified(step: &Step, bound: f64, rounds: usize, iterations: u32) -> Result<Optimum, f64> {
    let Some(objective) = step.primal else { return Err(f64::INFINITY) };
    let gap = objective - bound;
    if !(gap.abs() <= OPTIMALITY_GAP * objective.abs().max(1.0)) {
        return Err(gap);
    }
    Ok(Optimum {
        gap,
        objective,
        coefficients: step.coefficients.clone(),
        hessian: step.hessian.clone(),
        full_accuracy: step.full_accuracy,
        rounds,
        iterations,
    })
}

/// A start near the optimum. It already brings in the points that would be violated most: a round here costs
/// far less than one with the solver.
fn prepared(
    problem: &Problem,
    points: &[Vector3<f64>],
    active: &mut Active,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Option<Dual>, FitError> {
    let structure = problem.structure;
    for _ in 0..PREPARATIONS {
        let Some(near) = near_optimum(problem, &active.values, ROUGH_GAP) else { return Ok(None) };
        let NearOptimum { dual: mut start, coefficients } = near;
        let outside = violations(structure, points, &coefficients);
        let worst_violation = outside.first().map_or(0.0, |&(excess, _)| excess);
        let active_points = active.values.ncols();
        if progress(Progress { round: 0, active_points, worst_violation, decrement: None }).is_break() {
            return Err(FitError::Cancelled);
        }
        if worst_violation < PREPARED {
            break;
        }
        active.add(structure, points, &outside, &mut start);
    }
    Ok(near_optimum(problem, &active.values, GAP).map(|near| near.dual))
}

/// The problem with f scaled by a power of its size at `dual`.
fn sized<'a>(problem: Problem<'a>, dual: &Dual, power: i32) -> Option<Problem<'a>> {
    let size = problem.spectral.size(&problem.measured(dual))?;
    Some(Problem { spectral: problem.spectral.scaled(size.powi(power)), ..problem })
}

/// Points with p above 1, the farthest first.
fn violations(structure: &Structure, points: &[Vector3<f64>], coefficients: &DVector<f64>) -> Vec<(f64, usize)> {
    let mut outside: Vec<(f64, usize)> = points
        .iter()
        .enumerate()
        .map(|(index, point)| (structure.values(point).dot(coefficients) - 1.0, index))
        .filter(|&(excess, _)| excess > VIOLATION)
        .collect();
    outside.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    outside
}

/// The points a program knows.
struct Active {
    /// Which of the points are in.
    used: Vec<bool>,
    /// Index of each chosen point, none for points inside the hull.
    indices: Vec<Option<usize>>,
    chosen: Vec<Vector3<f64>>,
    /// Monomials of each chosen point, one column each.
    values: DMatrix<f64>,
}

impl Active {
    /// A well-spread subset, and as many points inside the hull: those constrain nothing, but with weight on them the
    /// moments are positive definite also when the points lie on a quadric, as the corners of a box do.
    fn start(structure: &Structure, points: &[Vector3<f64>]) -> Self {
        let wanted = (SPREAD * structure.gram.size).min(points.len());
        let mut used = vec![false; points.len()];
        let mut distance = vec![f64::INFINITY; points.len()];
        let mut chosen = Vec::new();
        let mut indices = Vec::new();
        let mut next = (0..points.len()).max_by(|&a, &b| points[a].norm().total_cmp(&points[b].norm())).unwrap_or(0);
        while chosen.len() < wanted {
            used[next] = true;
            indices.push(Some(next));
            chosen.push(points[next]);
            for (d, point) in distance.iter_mut().zip(points) {
                *d = d.min((point - points[next]).norm());
            }
            next = (0..points.len()).max_by(|&a, &b| distance[a].total_cmp(&distance[b])).unwrap_or(0);
        }
        let inner = 2 * structure.gram.size;
        let spread = chosen.len();
        for i in 0..inner {
            // four points from different quarters of the chosen ones, with weights that change from one mix to the next
            let corner = |k: usize| chosen[(i + k * (spread / 4).max(1)) % spread];
            let shares = [0.618_034, 0.754_878, 0.569_840, 0.819_173].map(|step| fraction(i, step).powi(3) + 0.01);
            let total: f64 = shares.iter().sum();
            chosen.push((0..4).map(|k| corner(k) * (shares[k] / total)).sum());
        }
        indices.resize(chosen.len(), None);
        let values = columns(structure, &chosen);
        Self { used, indices, chosen, values }
    }

    /// Leaves out the points with next to no weight, which are most of them.
    fn keep(&mut self, problem: &Problem, start: Dual) -> Dual {
        let least = NEGLIGIBLE * start.weights.sum();
        let kept: Vec<usize> = (0..self.chosen.len()).filter(|&i| start.weights[i] > least).collect();
        let weights = DVector::from_iterator(kept.len(), kept.iter().map(|&i| start.weights[i]));
        let values = self.values.select_columns(&kept);
        let moments = &values * &weights - problem.structure.pull_back(&start.form);
        let kept_dual = Dual { weights, moments, form: start.form.clone() };
        if problem.spectral.bound(&problem.measured(&kept_dual)).is_none() {
            return start;
        }
        for (position, index) in self.indices.iter().enumerate() {
            if let Some(index) = *index {
                self.used[index] = kept.binary_search(&position).is_ok();
            }
        }
        self.indices = kept.iter().map(|&i| self.indices[i]).collect();
        self.chosen = kept.iter().map(|&i| self.chosen[i]).collect();
        self.values = values;
        kept_dual
    }

    /// Equal weights, scaled to the optimum along their ray: they add up to N. With it goes the functional of the path's
    /// start if there is one, and none otherwise.
    fn uniform(&self, problem: &Problem) -> Dual {
        let structure = problem.structure;
        if let Some(start) = start(structure, &self.values) {
            return start;
        }
        let count = self.values.ncols();
        let weights = DVector::repeat(count, structure.gram.size as f64 / count as f64);
        Dual { moments: &self.values * &weights, weights, form: DVector::zeros(structure.hessian.keys) }
    }

    /// Adds the worst of the points outside, but not many from one spot.
    fn add(&mut self, structure: &Structure, points: &[Vector3<f64>], outside: &[(f64, usize)], dual: &mut Dual) {
        let limit = 2 * structure.gram.size;
        let mut added: Vec<Vector3<f64>> = Vec::new();
        for &(_, index) in outside {
            let point = points[index];
            if added.len() < limit && !self.used[index] && added.iter().all(|other| (other - point).norm() > 0.05) {
                self.used[index] = true;
                added.push(point);
                self.indices.push(Some(index));
            }
        }
        self.chosen.extend(added);
        self.values = columns(structure, &self.chosen);
        let weights = std::mem::replace(&mut dual.weights, DVector::zeros(0));
        dual.weights = weights.resize_vertically(self.chosen.len(), 0.0);
    }
}

fn columns(structure: &Structure, points: &[Vector3<f64>]) -> DMatrix<f64> {
    DMatrix::from_columns(&points.iter().map(|point| structure.values(point)).collect::<Vec<_>>())
}

/// Low-discrepancy sequence in the unit interval.
fn fraction(index: usize, step: f64) -> f64 {
    (index as f64 * step).fract()
}
