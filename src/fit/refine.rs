//! Smaller volumes: sequential convex programming on the volume itself.
//!
//! Log dets and traces only stand in for the volume. From the optimum of one, each step minimises a convex quadratic model of the
//! volume (`volume`) over the same sos-convex polynomials around the same points, by following the central path of that
//! program's dual, and goes that way as far as the volume falls. The feasible set is convex, so every polynomial on the way
//! is feasible, and the volume never grows.

use super::model::Model;
use super::path::{Goal, Interior, Path};
use super::program::Dual;
use super::structure::Structure;
use super::volume::{expansion, polynomial, volume};
use super::{FitError, ProgramError, Progress};
use crate::polynomial::Polynomial;
use nalgebra::{DMatrix, DVector, Vector3};
use std::ops::ControlFlow;

/// Steps at most.
const STEPS: usize = 30;
/// Relative decrease of the volume below which to stop.
const ENOUGH: f64 = 2e-5;
/// Accuracy of a step's program, relative to the volume.
const GAP: f64 = 1e-5;
/// Growth of τ from one centre to the next.
const GROWTH: f64 = 10.0;
/// Newton steps on one path at most.
const NEWTON_STEPS: usize = 3000;
/// The same on a path from the last optimum.
const WARM_STEPS: usize = 300;
/// Levenberg's term, relative to the mean curvature: directions that the rays see nothing of stay put.
const DAMPING: f64 = 1e-7;

/// What a refinement came to.
#[derive(Clone, Debug)]
pub(super) struct Refined {
    /// Coefficients of p, with `min p = 0`.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form.
    pub(super) hessian: DMatrix<f64>,
    /// Volume in the frame of p before the first step and after each, by the rule that is minimised.
    pub(super) volumes: Vec<f64>,
}

/// Refines a polynomial that is feasible for `points` (up to a constant) with the Gram matrix `hessian ⪰ margin`.
pub(super) fn refine(
    structure: &Structure,
    points: &[Vector3<f64>],
    margin: f64,
    coefficients: DVector<f64>,
    hessian: DMatrix<f64>,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Refined, FitError> {
    let values = DMatrix::from_columns(&points.iter().map(|x| structure.values(x)).collect::<Vec<_>>());
    let mut current = Interior { coefficients, hessian };
    // What the solver left outside is taken in by the constant.
    let highest = values.tr_mul(&current.coefficients).max();
    current.coefficients[0] -= (highest - 1.0).max(0.0);
    let mut volumes = Vec::new();
    let mut last = None;
    let mut center = Vector3::zeros();
    for step in 0..STEPS {
        center = normalise(structure, &mut current, &center)?;
        let p = polynomial(structure, &current.coefficients)?;
        let model = expansion(structure, &p, &center);
        if volumes.is_empty() {
            volumes.push(model.volume);
        }
        let report = Progress { round: step + 1, active_points: points.len(), worst_violation: 0.0, decrement: None };
        if progress(report).is_break() {
            return Err(FitError::Cancelled);
        }
        // A multiple of p - 1 describes the same set: p(center) is held, which fixes the multiple.
        let hold = structure.values(&center);
        let mean = model.curvature.trace() / hold.len() as f64;
        let mut curvature = model.curvature + &hold * hold.transpose() * (model.volume * 10.0);
        for i in 0..curvature.nrows() {
            curvature[(i, i)] += DAMPING * mean;
        }
        let program =
            Model::new(current.coefficients.clone(), model.gradient, curvature).ok_or(ProgramError::Singular)?;
        let path = Path::new(structure, &values, margin, Goal::Model(&program));
        // The last optimum is close to the next, but also to the boundary: from there the path is not always found.
        let warm = last.take().and_then(|dual| minimise(&path, model.volume, Some(dual), WARM_STEPS));
        let Some((target, dual)) = warm.or_else(|| minimise(&path, model.volume, None, NEWTON_STEPS)) else { break };
        last = Some(dual);
        let here = volumes.last().copied().unwrap_or(f64::INFINITY);
        let Some((next, smaller)) = search(structure, &current, &target, &center, here) else { break };
        volumes.push(smaller);
        current = next;
        if smaller > here * (1.0 - ENOUGH) {
            break;
        }
    }
    // The path ends a little inside the constraints: the constant takes that back, and then min p is 0.
    current.coefficients[0] += 1.0 - values.tr_mul(&current.coefficients).max();
    normalise(structure, &mut current, &center)?;
    Ok(Refined { coefficients: current.coefficients, hessian: current.hessian, volumes })
}

/// `p -> 1 + (p - 1)/(1 - min p)`: the same set with min p = 0. Returns the minimiser.
fn normalise(structure: &Structure, interior: &mut Interior, near: &Vector3<f64>) -> Result<Vector3<f64>, FitError> {
    let p = polynomial(structure, &interior.coefficients)?;
    let center = minimiser(&p, near).ok_or(ProgramError::Singular)?;
    let least = p.evaluate(&center).value;
    let factor = 1.0 / (1.0 - least);
    if !(factor > 0.0 && factor.is_finite()) {
        return Err(ProgramError::Singular.into());
    }
    interior.coefficients *= factor;
    interior.coefficients[0] += 1.0 - factor;
    interior.hessian *= factor;
    Ok(center)
}

/// Minimiser of a strictly convex polynomial by damped Newton steps.
fn minimiser(p: &Polynomial, start: &Vector3<f64>) -> Option<Vector3<f64>> {
    let mut z = *start;
    for _ in 0..200 {
        let jet = p.evaluate(&z);
        let step = jet.hessian.cholesky()?.solve(&jet.gradient);
        let decrease = step.dot(&jet.gradient);
        if decrease <= 1e-16 * (1.0 + jet.value.abs()) {
            break;
        }
        let shorter = |k: i32| (0.5_f64.powi(k), z - step * 0.5_f64.powi(k));
        z = (0..40).map(shorter).find(|(t, z)| p.evaluate(z).value <= jet.value - 0.25 * t * decrease)?.1;
    }
    Some(z)
}

/// The minimiser of the model, to [`GAP`], and the dual point to start the next from.
fn minimise(path: &Path, volume: f64, warm: Option<Dual>, steps: usize) -> Option<(Interior, Dual)> {
    let end = path.barrier_parameter() / (GAP * volume);
    let mut tau = if warm.is_some() { 1e-3 * end } else { 1e-6 * end };
    let mut dual = match warm {
        Some(dual) => dual,
        None => path.start()?,
    };
    for _ in 0..steps {
        let newton = path.step(&dual, tau)?;
        if newton.decrement < 0.9 {
            if tau >= end {
                return Some((path.interior(&dual, &newton, tau)?, newton.next));
            }
            tau = (tau * GROWTH).min(end);
        }
        dual = newton.next;
    }
    None
}

/// The polynomial on the way from `from` to `to` with about the smallest volume, if one is below `here`.
fn search(
    structure: &Structure,
    from: &Interior,
    to: &Interior,
    center: &Vector3<f64>,
    here: f64,
) -> Option<(Interior, f64)> {
    let at = |t: f64| Interior {
        coefficients: &from.coefficients + (&to.coefficients - &from.coefficients) * t,
        hessian: &from.hessian + (&to.hessian - &from.hessian) * t,
    };
    let measure = |t: f64| polynomial(structure, &at(t).coefficients).map_or(f64::INFINITY, |p| volume(&p, center));
    let mut best = (0.0, here);
    let mut length = 1.0;
    for _ in 0..12 {
        let value = measure(length);
        if value < best.1 {
            best = (length, value);
        } else if best.0 > 0.0 {
            break;
        }
        length *= 0.6;
    }
    (best.0 > 0.0).then(|| (at(best.0), best.1))
}
