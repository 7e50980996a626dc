//! Primal-dual interior-point method with slacks (Nocedal and Wright, Numerical Optimization,
//! chapter 19) and Mehrotra's choice of the centring. Slacks let a full Newton step leave a curved
//! boundary, which a method of feasible points has to creep along.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::ops::ControlFlow;

/// Most rows a program may have: 16 constraints for each of two bodies.
pub const MAX_ROWS: usize = 32;

/// Most iterations of [`minimise`]; 12 to 25 are usual.
const MAX_ITERATIONS: u32 = 80;

/// Largest fraction of the distance to zero by which one step may shorten slacks and multipliers;
/// dimensionless.
///
/// The usual value of primal-dual methods. Closer to 1, iterates stick to the boundary; smaller,
/// the convergence is slower. It changes the number of iterations only, and no test fixes it.
const TO_BOUNDARY: f64 = 0.995;

/// Least diagonal term of the Newton matrix, relative to the largest curvature; dimensionless.
///
/// Of the size of rounding: it changes no step, and makes singular matrices factorizable. A larger
/// value slows the convergence where curvatures differ much; a smaller one is lost in rounding.
/// Pinned by `extents_of_exact_bodies_match_closed_forms`.
const LEAST_REGULARIZATION: f64 = 1e-15;

/// Most halvings of one step.
const MAX_BACKTRACKS: u32 = 30;

/// Value, gradient and curvature of one constraint `c(v) <= 0`.
#[derive(Clone, Copy, Debug)]
pub struct Row<const N: usize> {
    /// Value c(v).
    pub value: f64,
    /// Gradient with respect to all variables.
    pub gradient: SVector<f64, N>,
    /// Hessian with respect to the three variables from `block` on; the constraint is affine in the
    /// others.
    pub hessian: Matrix3<f64>,
    /// First of the three curved variables.
    pub block: usize,
}

impl<const N: usize> Row<N> {
    /// A row curved in the three variables from `block` on and affine in the last variable with
    /// slope `last` (if it is not one of the three).
    pub fn new(value: f64, gradient: &Vector3<f64>, hessian: Matrix3<f64>, block: usize, last: f64) -> Self {
        let mut full = SVector::<f64, N>::zeros();
        full[N - 1] = last;
        full.fixed_rows_mut::<3>(block).copy_from(gradient);
        Self { value, gradient: full, hessian, block }
    }
}

/// The rows of a program at one point, on the stack.
#[derive(Clone, Copy, Debug)]
pub struct Rows<const N: usize> {
    rows: [Row<N>; MAX_ROWS],
    len: usize,
}

impl<const N: usize> Rows<N> {
    fn empty() -> Self {
        let blank = Row { value: 0.0, gradient: SVector::zeros(), hessian: Matrix3::zeros(), block: 0 };
        Self { rows: [blank; MAX_ROWS], len: 0 }
    }

    /// Adds a row; a program has at most [`MAX_ROWS`].
    pub fn push(&mut self, row: Row<N>) {
        self.rows[self.len] = row;
        self.len += 1;
    }

    fn as_slice(&self) -> &[Row<N>] {
        &self.rows[..self.len]
    }

    /// Largest value.
    fn worst(&self) -> f64 {
        self.as_slice().iter().fold(f64::NEG_INFINITY, |worst, row| worst.max(row.value))
    }
}

/// A convex program `min f(v)` subject to `c_i(v) <= 0` in N variables.
pub trait Program<const N: usize> {
    /// Gradient and Hessian of the objective at `v`.
    fn objective(&self, v: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>);
    /// All constraints at `v`, always in the same order.
    fn constraints(&self, v: &SVector<f64, N>, rows: &mut Rows<N>);
}

/// What the caller sees of the solve after each step.
pub struct Iterate<'a, const N: usize> {
    /// Point; constraints may be violated by little.
    pub v: &'a SVector<f64, N>,
    /// Multipliers of the constraints, in their order; all positive.
    pub multipliers: &'a [f64],
    /// Complementarity `Σ s_i λ_i` with the slacks s: the duality gap once all else is optimal.
    pub gap: f64,
}

/// Minimises a convex program from the strictly feasible `v`, showing each iterate to `inspect`,
/// until that breaks off or no further progress is possible. Returns the number of iterations.
///
/// `gap` is the size of improvement expected of the objective; it sets the first multipliers. A
/// start that is not strictly feasible returns at once.
pub fn minimise<const N: usize, P: Program<N>>(
    program: &P,
    v: &mut SVector<f64, N>,
    gap: f64,
    inspect: impl FnMut(&Iterate<'_, N>) -> ControlFlow<()>,
) -> u32 {
    minimise_within(f64::INFINITY, program, v, gap, inspect)
}

/// As [`minimise`], with no step to where a constraint is above `farthest` that was not before:
/// slower, but from far outside thin bodies the way back may be too long.
pub fn minimise_within<const N: usize, P: Program<N>>(
    farthest: f64,
    program: &P,
    v: &mut SVector<f64, N>,
    gap: f64,
    mut inspect: impl FnMut(&Iterate<'_, N>) -> ControlFlow<()>,
) -> u32 {
    // Two buffers, of the current point and of the one on trial, so that a step copies no rows.
    let mut buffers = [Rows::empty(), Rows::empty()];
    let [mut current, mut trial_rows] = buffers.each_mut();
    program.constraints(v, current);
    let m = current.len;
    if m == 0 || !current.as_slice().iter().all(|row| row.value < 0.0) {
        return 0;
    }
    let mut dual = Dual { multipliers: [0.0; MAX_ROWS], slacks: [0.0; MAX_ROWS] };
    for (i, row) in current.as_slice().iter().enumerate() {
        dual.slacks[i] = -row.value;
        dual.multipliers[i] = gap / m as f64 / -row.value;
    }
    let mut last = 1.0;
    let mut regularization = LEAST_REGULARIZATION;
    for iteration in 1..=MAX_ITERATIONS {
        let (gradient, hessian) = program.objective(v);
        let rows = current.as_slice();
        let Some(system) = System::factor(&gradient, hessian, rows, &dual, regularization) else {
            return iteration;
        };
        // Predictor: a step towards zero complementarity shows how far the multipliers and slacks
        // allow it.
        let complementarity = dual.complementarity(m);
        let affine = system.step(&gradient, rows, &dual, 0.0);
        let (primal, multipliers) = affine.longest(&dual, m);
        let reach = primal.min(multipliers).min(1.0);
        // Complementarity must not run ahead of the other conditions, or the next steps are short.
        let infeasibility = dual.residual(&gradient, rows, complementarity / m as f64);
        if !(complementarity.is_finite() && infeasibility.is_finite()) {
            return iteration;
        }
        // A short step shows that the last target was out of reach: centre first.
        let floor = if last < 0.5 { 0.5 } else { (0.1 * infeasibility / complementarity).clamp(1e-4, 0.3) };
        let centring = (1.0 - reach).powi(3).clamp(floor, 0.8);
        let target = centring * complementarity / m as f64;
        let step = system.step(&gradient, rows, &dual, target);

        let before = dual.residual(&gradient, rows, target);
        let (primal, multipliers) = step.longest(&dual, m);
        let mut lengths = [primal, multipliers].map(|longest| (TO_BOUNDARY * longest).min(1.0));
        let mut accepted = false;
        for _ in 0..MAX_BACKTRACKS {
            let trial = *v + step.v * lengths[0];
            let trial_dual = dual.moved(&step, lengths);
            trial_rows.len = 0;
            program.constraints(&trial, trial_rows);
            let (trial_gradient, _) = program.objective(&trial);
            let after = trial_dual.residual(&trial_gradient, trial_rows.as_slice(), target);
            if after <= 4.0 * before && trial_rows.worst() <= farthest.max(current.worst()) {
                (*v, dual, accepted) = (trial, trial_dual, true);
                break;
            }
            // Unequal steps need not reduce the residual; equal ones do.
            let shorter = 0.5 * lengths[0].min(lengths[1]);
            lengths = if lengths[0] == lengths[1] { [shorter; 2] } else { [2.0 * shorter; 2] };
        }
        if !accepted {
            // A direction without curvature at this point makes the step longer than any halving
            // mends.
            if regularization > 1.0 {
                return iteration;
            }
            regularization *= 1e3;
            continue;
        }
        regularization = (regularization * 1e-3).max(LEAST_REGULARIZATION);
        last = lengths[0].min(lengths[1]);
        (current, trial_rows) = (trial_rows, current);
        let gap = dual.complementarity(m);
        if inspect(&Iterate { v, multipliers: &dual.multipliers[..m], gap }).is_break() {
            return iteration;
        }
    }
    MAX_ITERATIONS
}

/// Multipliers λ > 0 and slacks s > 0 of the rows, `c_i(v) + s_i = 0` at the solution.
#[derive(Clone, Copy)]
struct Dual {
    multipliers: [f64; MAX_ROWS],
    slacks: [f64; MAX_ROWS],
}

impl Dual {
    /// `Σ s_i λ_i` over the first m rows.
    fn complementarity(&self, m: usize) -> f64 {
        self.slacks.iter().zip(&self.multipliers).take(m).map(|(slack, multiplier)| slack * multiplier).sum()
    }

    /// Norm of the perturbed optimality conditions `∇f + Σ λ_i ∇c_i = 0`, `c_i + s_i = 0`, `s_i λ_i
    /// = target`.
    fn residual<const N: usize>(&self, gradient: &SVector<f64, N>, rows: &[Row<N>], target: f64) -> f64 {
        let mut stationarity = *gradient;
        let mut rest = 0.0;
        for (i, row) in rows.iter().enumerate() {
            stationarity += row.gradient * self.multipliers[i];
            rest += (row.value + self.slacks[i]).powi(2) + (self.slacks[i] * self.multipliers[i] - target).powi(2);
        }
        (stationarity.norm_squared() + rest).sqrt()
    }

    fn moved<const N: usize>(&self, step: &Step<N>, [primal, multipliers]: [f64; 2]) -> Self {
        let mut moved = *self;
        for i in 0..MAX_ROWS {
            moved.slacks[i] += primal * step.slacks[i];
            moved.multipliers[i] += multipliers * step.multipliers[i];
        }
        moved
    }
}

/// A step in the variables, multipliers and slacks.
struct Step<const N: usize> {
    v: SVector<f64, N>,
    multipliers: [f64; MAX_ROWS],
    slacks: [f64; MAX_ROWS],
}

impl<const N: usize> Step<N> {
    /// Longest steps that keep the slacks and the multipliers of the first m rows at or above zero,
    /// at most 2.
    fn longest(&self, dual: &Dual, m: usize) -> (f64, f64) {
        let longest = |values: &[f64; MAX_ROWS], changes: &[f64; MAX_ROWS]| {
            let ratios = values.iter().zip(changes).take(m).filter(|(_, change)| **change < 0.0);
            ratios.map(|(value, change)| -value / change).fold(2.0, f64::min)
        };
        (longest(&dual.slacks, &self.slacks), longest(&dual.multipliers, &self.multipliers))
    }
}

/// The factorized Newton matrix `∇²L + Σ λ_i / s_i ∇c_i ∇c_iᵀ`.
struct System<const N: usize> {
    factor: SMatrix<f64, N, N>,
}

impl<const N: usize> System<N> {
    fn factor(
        gradient: &SVector<f64, N>,
        mut hessian: SMatrix<f64, N, N>,
        rows: &[Row<N>],
        dual: &Dual,
        regularization: f64,
    ) -> Option<Self> {
        for (i, row) in rows.iter().enumerate() {
            let mut block = hessian.fixed_view_mut::<3, 3>(row.block, row.block);
            block += row.hessian * dual.multipliers[i];
            hessian.ger(dual.multipliers[i] / dual.slacks[i], &row.gradient, &row.gradient, 1.0);
        }
        // Flat starts have no curvature at all; the gradient then sets the scale.
        let scale = hessian.diagonal().amax().max(1e-6 * gradient.amax());
        if !scale.is_finite() || !gradient.norm_squared().is_finite() {
            return None;
        }
        // Levenberg's regularization, only as large as the factorization and the line search need.
        let mut regularization = regularization * scale;
        for _ in 0..8 {
            if let Some(factor) = cholesky(hessian + SMatrix::identity() * regularization) {
                return Some(Self { factor });
            }
            regularization *= 100.0;
        }
        None
    }

    /// Newton step towards `s_i λ_i = target` in every row.
    fn step(&self, gradient: &SVector<f64, N>, rows: &[Row<N>], dual: &Dual, target: f64) -> Step<N> {
        let mut v = -*gradient;
        for (i, row) in rows.iter().enumerate() {
            let infeasibility = row.value + dual.slacks[i];
            v -= row.gradient * ((target + dual.multipliers[i] * infeasibility) / dual.slacks[i]);
        }
        substitute(&self.factor, &mut v);
        let mut step = Step { v, multipliers: [0.0; MAX_ROWS], slacks: [0.0; MAX_ROWS] };
        for (i, row) in rows.iter().enumerate() {
            let (slack, multiplier) = (dual.slacks[i], dual.multipliers[i]);
            step.slacks[i] = -(row.value + slack) - row.gradient.dot(&v);
            step.multipliers[i] = (target - multiplier * step.slacks[i]) / slack - multiplier;
        }
        step
    }
}

/// Lower Cholesky factor, or none if a pivot is not positive.
fn cholesky<const N: usize>(mut a: SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    for j in 0..N {
        for k in 0..j {
            let ljk = a[(j, k)];
            for i in j..N {
                a[(i, j)] -= a[(i, k)] * ljk;
            }
        }
        let pivot = a[(j, j)];
        if !(pivot > 0.0) {
            return None;
        }
        let inverse = 1.0 / pivot.sqrt();
        for i in j..N {
            a[(i, j)] *= inverse;
        }
    }
    Some(a)
}

/// Solves `L Lᵀ x = b` in place.
fn substitute<const N: usize>(l: &SMatrix<f64, N, N>, b: &mut SVector<f64, N>) {
    for i in 0..N {
        for k in 0..i {
            b[i] -= l[(i, k)] * b[k];
        }
        b[i] /= l[(i, i)];
    }
    for i in (0..N).rev() {
        for k in i + 1..N {
            b[i] -= l[(k, i)] * b[k];
        }
        b[i] /= l[(i, i)];
    }
}
