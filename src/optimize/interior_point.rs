//! Primal-dual interior-point method with strictly feasible iterates (Boyd and Vandenberghe, Convex Optimization,
//! section 11.7) and Mehrotra's choice of the centring.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::ops::ControlFlow;

/// Most rows a program may have: 16 constraints for each of two bodies.
pub const MAX_ROWS: usize = 32;

/// Most iterations of [`minimise`]; 12 to 25 are usual.
const MAX_ITERATIONS: u32 = 80;

/// Largest fraction of the way to the boundary one step may go.
const TO_BOUNDARY: f64 = 0.995;

/// Value, gradient and curvature of one constraint `c(v) <= 0`.
#[derive(Clone, Copy, Debug)]
pub struct Row<const N: usize> {
    /// Value c(v).
    pub value: f64,
    /// Gradient with respect to all variables.
    pub gradient: SVector<f64, N>,
    /// Hessian with respect to the three variables from `block` on; the constraint is affine in the others.
    pub hessian: Matrix3<f64>,
    /// First of the three curved variables.
    pub block: usize,
}

impl<const N: usize> Row<N> {
    /// A row curved in the three variables from `block` on and affine in the last variable with slope `last` (if it is not
    /// one of the three).
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
}

/// A convex program `min f(v)` subject to `c_i(v) <= 0` in N variables.
pub trait Program<const N: usize> {
    /// Gradient and Hessian of the objective at `v`.
    fn objective(&self, v: &SVector<f64, N>) -> (SVector<f64, N>, SMatrix<f64, N, N>);
    /// All constraints at `v`, always in the same order.
    fn constraints(&self, v: &SVector<f64, N>, rows: &mut Rows<N>);
}

/// What the caller sees of the solve after each step: a strictly feasible point and positive multipliers.
pub struct Iterate<'a, const N: usize> {
    /// Strictly feasible point.
    pub v: &'a SVector<f64, N>,
    /// Multipliers of the constraints, in their order; all positive.
    pub multipliers: &'a [f64],
    /// Complementarity `Σ -c_i λ_i`: the duality gap once the gradient of the Lagrangian vanishes.
    pub gap: f64,
}

/// Minimises a convex program from the strictly feasible `v`, showing each iterate to `inspect`, until that breaks off or
/// no further progress is possible. Returns the number of iterations.
///
/// `gap` is the size of improvement expected of the objective; it sets the first multipliers. A start that is not strictly
/// feasible returns at once.
pub fn minimise<const N: usize, P: Program<N>>(
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
    let mut multipliers = [0.0; MAX_ROWS];
    for (multiplier, row) in multipliers.iter_mut().zip(current.as_slice()) {
        *multiplier = gap / m as f64 / -row.value;
    }
    for iteration in 1..=MAX_ITERATIONS {
        let (gradient, hessian) = program.objective(v);
        let rows = current.as_slice();
        let Some(system) = System::factor(&gradient, hessian, rows, &multipliers) else {
            return iteration;
        };
        // Predictor: aim at zero complementarity and see how far the multipliers and slacks allow it.
        let complementarity = complementarity(rows, &multipliers);
        let affine = system.step(&gradient, rows, &multipliers, 0.0);
        let reach = affine.longest(rows, &multipliers).min(1.0);
        let centring = (1.0 - reach).powi(3).clamp(1e-4, 0.8);
        let target = centring * complementarity / m as f64;
        let step = system.step(&gradient, rows, &multipliers, target);

        let before = residual(&gradient, rows, &multipliers, target);
        let mut length = (TO_BOUNDARY * step.longest(rows, &multipliers)).min(1.0);
        let mut accepted = false;
        for _ in 0..40 {
            let trial = *v + step.v * length;
            trial_rows.len = 0;
            program.constraints(&trial, trial_rows);
            let inside =
                trial_rows.as_slice().iter().zip(rows).all(|(new, old)| new.value < (1.0 - TO_BOUNDARY) * old.value);
            if inside {
                let mut trial_multipliers = multipliers;
                for (multiplier, change) in trial_multipliers.iter_mut().zip(&step.multipliers) {
                    *multiplier += length * change;
                }
                let (trial_gradient, _) = program.objective(&trial);
                let after = residual(&trial_gradient, trial_rows.as_slice(), &trial_multipliers, target);
                if after <= (1.0 - 0.01 * length) * before || after < 1e-15 {
                    (*v, multipliers, accepted) = (trial, trial_multipliers, true);
                    break;
                }
            }
            length *= 0.6;
        }
        if !accepted {
            return iteration;
        }
        (current, trial_rows) = (trial_rows, current);
        let gap = self::complementarity(current.as_slice(), &multipliers);
        if inspect(&Iterate { v, multipliers: &multipliers[..m], gap }).is_break() {
            return iteration;
        }
    }
    MAX_ITERATIONS
}

/// `Σ -c_i λ_i`.
fn complementarity<const N: usize>(rows: &[Row<N>], multipliers: &[f64; MAX_ROWS]) -> f64 {
    rows.iter().zip(multipliers).map(|(row, multiplier)| -row.value * multiplier).sum()
}

/// Norm of the perturbed optimality conditions `∇f + Σ λ_i ∇c_i = 0`, `-c_i λ_i = target`.
fn residual<const N: usize>(
    gradient: &SVector<f64, N>,
    rows: &[Row<N>],
    multipliers: &[f64; MAX_ROWS],
    target: f64,
) -> f64 {
    let mut dual = *gradient;
    let mut central = 0.0;
    for (row, multiplier) in rows.iter().zip(multipliers) {
        dual += row.gradient * *multiplier;
        let deviation = -row.value * multiplier - target;
        central += deviation * deviation;
    }
    (dual.norm_squared() + central).sqrt()
}

/// A step in the variables and multipliers.
struct Step<const N: usize> {
    v: SVector<f64, N>,
    multipliers: [f64; MAX_ROWS],
}

impl<const N: usize> Step<N> {
    /// Longest step that keeps the multipliers and the linearized constraints at or above zero, at most 2.
    fn longest(&self, rows: &[Row<N>], multipliers: &[f64; MAX_ROWS]) -> f64 {
        let mut longest = 2.0_f64;
        for ((row, multiplier), change) in rows.iter().zip(multipliers).zip(&self.multipliers) {
            if *change < 0.0 {
                longest = longest.min(-multiplier / change);
            }
            let slope = row.gradient.dot(&self.v);
            if slope > 0.0 {
                longest = longest.min(-row.value / slope);
            }
        }
        longest
    }
}

/// The factorized Newton matrix `∇²L + Σ λ_i / -c_i ∇c_i ∇c_iᵀ`.
struct System<const N: usize> {
    factor: SMatrix<f64, N, N>,
}

impl<const N: usize> System<N> {
    fn factor(
        gradient: &SVector<f64, N>,
        mut hessian: SMatrix<f64, N, N>,
        rows: &[Row<N>],
        multipliers: &[f64; MAX_ROWS],
    ) -> Option<Self> {
        for (row, multiplier) in rows.iter().zip(multipliers) {
            let mut block = hessian.fixed_view_mut::<3, 3>(row.block, row.block);
            block += row.hessian * *multiplier;
            let weight = multiplier / -row.value;
            hessian.ger(weight, &row.gradient, &row.gradient, 1.0);
        }
        // Flat starts have no curvature at all; the gradient then sets the scale.
        let scale = hessian.diagonal().amax().max(1e-6 * gradient.amax());
        if !scale.is_finite() || !gradient.norm_squared().is_finite() {
            return None;
        }
        // Levenberg's regularization, only as large as the factorization needs.
        let mut regularization = 1e-15 * scale;
        for _ in 0..8 {
            if let Some(factor) = cholesky(hessian + SMatrix::identity() * regularization) {
                return Some(Self { factor });
            }
            regularization *= 100.0;
        }
        None
    }

    /// Newton step towards complementarity `target` in every row.
    fn step(&self, gradient: &SVector<f64, N>, rows: &[Row<N>], multipliers: &[f64; MAX_ROWS], target: f64) -> Step<N> {
        let mut v = -*gradient;
        for row in rows {
            v -= row.gradient * (target / -row.value);
        }
        substitute(&self.factor, &mut v);
        let mut changes = [0.0; MAX_ROWS];
        for ((change, row), multiplier) in changes.iter_mut().zip(rows).zip(multipliers) {
            *change = (target + multiplier * row.gradient.dot(&v)) / -row.value - multiplier;
        }
        Step { v, multipliers: changes }
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
