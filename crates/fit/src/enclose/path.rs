//! The central path of the dual of an enclosing program, followed by Newton's method.
//!
//! Wanted is the sos-convex p with the largest `log det P` that is proven at most 1 on sets S_k:
//!
//! ```text
//! minimise  -log det P   subject to  p = zᵀPz,  yᵀ∇²p y = wᵀHw,  H ⪰ εI,
//!                              1 - p = σ_k + Σ_j τ_kj (1 - g_kj),  all σ and τ sums of squares
//! ```
//!
//! (Ahmadi, Hall, Makadia and Sindhwani, RSS 2017, section V). In its dual each set has a
//! functional y_k that is nonnegative on squares and on squares times each `1 - g_kj`, where a fit
//! to points has weights of evaluations at points:
//!
//! ```text
//! maximise  log det M(m) + N - Σ y_k(1) + ε tr S(s)
//! subject to  m = Σ y_k|p - D*s,  M_kj(y_k) ⪰ 0,  S(s) ⪰ 0
//! ```
//!
//! with y_k|p its values on the monomials of p, which have another frame. All but the term of m is
//! a sum over blocks, so a Newton step of the barrier problem costs a factorization per block and
//! one of the size of p (Woodbury). Near a centre the step predicts a strictly feasible p with all
//! Gram matrices: its equations are the identities above.

use super::localizing::LocalizingMatrix;
use crate::FitError;
use crate::factor::{regularised_factor, solve_lower};
use crate::progress::Watch;
use crate::structure::Structure;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::borrow::Cow;

/// Newton decrement below which a point counts as a centre; 1 is where its polynomial stops being
/// feasible.
const CENTRED: f64 = 0.9;
/// Growth of τ from one centre to the next.
const GROWTH: f64 = 10.0;
/// Growth of τ below which a path that rounding blocks is given up.
const LEAST_GROWTH: f64 = 1.3;
/// Newton steps at most.
const MAX_NEWTON_STEPS: usize = 300;

/// Variables with their own barrier: the functional of a set, or of the Hessian form.
pub(super) struct Block<'a> {
    /// Matrices that stay definite; of the first, the Gram matrix takes what rounding leaves.
    pub(super) cones: Cow<'a, [LocalizingMatrix]>,
    /// Cost of the variables.
    pub(super) cost: DVector<f64>,
    /// What they add to m: monomials of p x variables.
    pub(super) map: DMatrix<f64>,
    /// Where to start.
    pub(super) start: DVector<f64>,
}

/// The barrier problem `τ (-log det M(m) + Σ cost) - Σ log det` over the blocks.
pub(super) struct Path<'a> {
    pub(super) structure: &'a Structure,
    pub(super) blocks: Vec<Block<'a>>,
}

/// A strictly feasible polynomial.
#[derive(Clone, Debug)]
pub(super) struct Iterate {
    /// Its coefficients.
    pub(super) coefficients: DVector<f64>,
    /// Its Gram matrix P.
    gram: DMatrix<f64>,
    /// The Gram matrices of each block's cones.
    pub(super) grams: Vec<Vec<DMatrix<f64>>>,
    /// The dual point.
    variables: Vec<DVector<f64>>,
    tau: f64,
}

/// A damped Newton step.
struct Newton {
    next: Vec<DVector<f64>>,
    whole: Vec<DVector<f64>>,
    decrement: f64,
    /// τ times the coefficients of p that the full step predicts.
    coefficients: DVector<f64>,
}

impl Path<'_> {
    /// At a centre, this over τ is the distance to the optimum.
    fn barrier_parameter(&self) -> f64 {
        self.blocks.iter().flat_map(|block| block.cones.iter()).map(LocalizingMatrix::size).sum::<usize>() as f64
    }

    fn moments(&self, variables: &[DVector<f64>]) -> DVector<f64> {
        self.blocks.iter().zip(variables).map(|(block, y)| &block.map * y).sum()
    }

    /// Follows the path until the objective is known to `gap`; the last centre before rounding
    /// stood in the way, if that is earlier.
    ///
    /// # Errors
    /// [`FitError::Cancelled`].
    pub(super) fn follow(&self, gap: f64, watch: &mut Watch) -> Result<Option<Iterate>, FitError> {
        let end = self.barrier_parameter() / gap;
        let (mut tau, mut growth) = (1.0, GROWTH);
        let mut variables: Vec<_> = self.blocks.iter().map(|block| block.start.clone()).collect();
        let mut last: Option<Iterate> = None;
        for _ in 0..MAX_NEWTON_STEPS {
            watch.iteration(self.barrier_parameter() / tau)?;
            let newton = self.step(&variables, tau);
            let centred = newton.as_ref().is_some_and(|newton| newton.decrement < CENTRED);
            let centre = newton.as_ref().filter(|_| centred).and_then(|newton| self.centre(&variables, newton, tau));
            match (newton, centre) {
                (Some(_), Some(centre)) => {
                    variables.clone_from(&centre.variables);
                    last = Some(centre);
                    if tau >= end {
                        break;
                    }
                    tau = (tau * growth).min(end);
                }
                (Some(newton), None) if !centred => variables = newton.next,
                // Rounding: from the last centre a shorter way may still be open.
                _ => {
                    growth = growth.sqrt();
                    let Some(centre) = last.as_ref().filter(|_| growth > LEAST_GROWTH) else { break };
                    variables.clone_from(&centre.variables);
                    tau = centre.tau * growth;
                }
            }
        }
        Ok(last)
    }

    /// `-log det P` of a centre, and how far below it the optimum may lie.
    pub(super) fn objective(&self, centre: &Iterate) -> Option<(f64, f64)> {
        let value = -log_det(&centre.gram)?;
        let moments = self.structure.gram.spread(&self.moments(&centre.variables));
        let cost: f64 = self.blocks.iter().zip(&centre.variables).map(|(block, y)| block.cost.dot(y)).sum();
        Some((value, value - (log_det(&moments)? + moments.nrows() as f64 - cost)))
    }

    /// Objective of the barrier problem; none outside its domain.
    fn barrier(&self, variables: &[DVector<f64>], tau: f64) -> Option<f64> {
        let of_moments = -tau * log_det(&self.structure.gram.spread(&self.moments(variables)))?;
        self.blocks.iter().zip(variables).try_fold(of_moments, |sum, (block, y)| {
            let log_dets = block.cones.iter().map(|cone| cone.log_det(y)).sum::<Option<f64>>()?;
            Some(sum + tau * block.cost.dot(y) - log_dets)
        })
    }

    /// A damped Newton step; none when rounding stands in its way.
    fn step(&self, at: &[DVector<f64>], tau: f64) -> Option<Newton> {
        // 1. The part of m: minus its gradient, τ times the coefficients of p, and the inverse of
        //    its Hessian.
        let pattern = &self.structure.gram;
        let inverse = Cholesky::new(pattern.spread(&self.moments(at)))?.inverse();
        let coefficients = pattern.collapse(&inverse) * tau;
        let factor = regularised_factor(&(pattern.congruence(&inverse) * tau))?;
        let root = solve_lower(&factor, DMatrix::identity(pattern.keys, pattern.keys))?;
        let mut middle = root.tr_mul(&root);
        // 2. The blocks, each with the half step that its own factor gives.
        let mut plain = DVector::zeros(pattern.keys);
        let mut halves = Vec::with_capacity(self.blocks.len());
        for (block, y) in self.blocks.iter().zip(at) {
            let mut gradient = &block.cost * tau - block.map.tr_mul(&coefficients);
            let mut curvature = DMatrix::zeros(y.len(), y.len());
            for cone in block.cones.iter() {
                let (slope, bend) = cone.derivatives(y)?;
                gradient -= slope;
                curvature += bend;
            }
            let factor = regularised_factor(&curvature)?;
            let half = solve_lower(&factor, block.map.transpose())?;
            let half_gradient = factor.solve_lower_triangular(&gradient)?;
            middle += half.tr_mul(&half);
            plain += half.tr_mul(&half_gradient);
            halves.push((factor, half, half_gradient, gradient));
        }
        let multiplier = Cholesky::new(middle)?.solve(&plain);
        let mut slope = 0.0;
        let mut steps = Vec::with_capacity(halves.len());
        for (factor, half, half_gradient, gradient) in halves {
            let step = -factor.tr_solve_lower_triangular(&(half_gradient - half * &multiplier))?;
            slope += gradient.dot(&step);
            steps.push(step);
        }
        if slope.is_nan() || slope > 0.0 {
            return None;
        }
        // 3. Shortened until everything stays definite and the objective falls.
        let along = |length: f64| at.iter().zip(&steps).map(|(y, step)| y + step * length).collect::<Vec<_>>();
        let here = self.barrier(at, tau)?;
        let next = (0..40).find_map(|shortening| {
            let length = 0.7_f64.powi(shortening);
            let next = along(length);
            let sufficient = here + 0.1 * length * slope + 1e-9 * here.abs();
            self.barrier(&next, tau).is_some_and(|value| value <= sufficient).then_some(next)
        })?;
        // The multiplier is minus the Hessian of the part of m times the full step.
        let coefficients = coefficients + multiplier;
        Some(Newton { next, whole: along(1.0), decrement: (-slope).sqrt(), coefficients })
    }

    /// The polynomial that a Newton step from `at` predicts with its Gram matrices; none if
    /// rounding costs it what mathematics promises for decrements below 1: that all are definite.
    fn centre(&self, at: &[DVector<f64>], newton: &Newton, tau: f64) -> Option<Iterate> {
        let coefficients = &newton.coefficients / tau;
        let mut grams = Vec::with_capacity(self.blocks.len());
        for ((block, at), whole) in self.blocks.iter().zip(at).zip(&newton.whole) {
            let predicted = |cone: &LocalizingMatrix| Some(cone.predicted(at, whole)? / tau);
            let mut of_block = block.cones.iter().map(predicted).collect::<Option<Vec<_>>>()?;
            // The first takes what the others leave of the identity.
            let others = block.cones.iter().zip(&of_block).skip(1).map(|(cone, gram)| cone.collapse(gram));
            let left = others.fold(&block.cost - block.map.tr_mul(&coefficients), |left, other| left - other);
            of_block[0] = block.cones[0].nearest(&of_block[0], &left);
            of_block.iter().try_for_each(|gram| Cholesky::new(gram.clone()).map(|_| ()))?;
            grams.push(of_block);
        }
        let pattern = &self.structure.gram;
        let inverse = Cholesky::new(pattern.spread(&self.moments(at)))?.inverse();
        let predicted = &inverse * 2.0 - &inverse * pattern.spread(&self.moments(&newton.whole)) * &inverse;
        let gram = pattern.nearest(&((&predicted + predicted.transpose()) * 0.5), &coefficients);
        Some(Iterate { coefficients, gram, grams, variables: newton.next.clone(), tau })
    }
}

fn log_det(matrix: &DMatrix<f64>) -> Option<f64> {
    let factor = Cholesky::new(matrix.clone())?;
    let value = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    value.is_finite().then_some(value)
}
