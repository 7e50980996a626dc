//! Smaller volumes: sequential convex programming on the volume itself.
//!
//! Log dets and traces only stand in for the volume. From the optimum of one, each step minimises a
//! convex quadratic model of the volume (`volume`) over the same sos-convex polynomials around the
//! same points, by following the central path of that program's dual, and moves towards it as long
//! as the volume falls. The feasible set is convex, so every polynomial in between is feasible, and
//! the volume never grows.

use super::active_points::inner;
use super::model::Model;
use super::path::{DualPoint, Interior, Path, PathObjective, PathOptions};
use super::progress::Watch;
use super::structure::Structure;
use super::volume::{Expansion, expansion, polynomial, volume};
use super::{FitError, ProgramError};
use nalgebra::{DMatrix, DVector, Vector3};
use sublevel_core::polynomial::Polynomial;

/// Steps at most.
const MAX_VOLUME_STEPS: usize = 30;

/// Relative decrease of the volume below which a refinement ends; dimensionless.
///
/// Steps converge linearly. A larger value ends early with larger bodies; a smaller one takes steps
/// that nobody notices. Pinned by `refinement_is_monotone_contains_the_points_and_is_proven` and
/// `refined_volumes`.
const REFINED_VOLUME_DECREASE: f64 = 2e-5;

/// Accuracy of a step's program, relative to the volume; dimensionless.
///
/// Half of [`REFINED_VOLUME_DECREASE`], so that a step's decrease is not its error. A larger value
/// ends refinements early; a smaller one takes more Newton steps. Pinned by
/// `refinement_is_monotone_contains_the_points_and_is_proven`.
const PATH_STEP_GAP: f64 = 1e-5;
/// Growth of τ from one centre to the next.
const GROWTH: f64 = 10.0;
/// Where a path starts, as a part of its last τ: nearer, and the first centre is far; farther, and
/// there are more of them.
const COLD: f64 = 1e-5;
/// Newton steps on one path at most.
const COLD_STEPS: usize = 3000;
/// As [`COLD`], from the last optimum.
const WARM: f64 = 1e-2;
/// As [`COLD_STEPS`], from the last optimum: what works takes a few tens.
const WARM_STEPS: usize = 80;

/// Levenberg's term, relative to the mean curvature; dimensionless: it keeps directions that no ray
/// measures where they are.
///
/// A larger value shortens all steps; a smaller one makes the model singular to rounding. Pinned by
/// `refinement_is_monotone_contains_the_points_and_is_proven`.
const DAMPING: f64 = 1e-7;

/// Why a refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefinementEnd {
    /// The last step hardly made the volume smaller.
    Converged,
    /// No polynomial on the way to a step's optimum had a smaller volume.
    NoDescent,
    /// The program of a step could not be solved; the steps before it count.
    Unsolved,
    /// The volume was still falling after the last step allowed.
    StepLimit,
}

impl std::fmt::Display for RefinementEnd {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::NoDescent => "no smaller volume was found on the way of the last step",
            Self::Unsolved => "the program of the last step could not be solved",
            Self::StepLimit => "the volume was still falling after the last step allowed",
        })
    }
}

/// What a refinement came to.
#[derive(Clone, Debug)]
pub(super) struct Refined {
    /// Coefficients of p, with `min p = 0`.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form.
    pub(super) hessian: DMatrix<f64>,
    /// Volume in the frame of p before the first step and after each, by the rule that is
    /// minimised.
    pub(super) volumes: Vec<f64>,
    /// Why there are no more steps.
    pub(super) end: RefinementEnd,
}

/// Refines a polynomial that is feasible for `points` (up to a constant) with a Gram matrix `⪰
/// margin` of its Hessian form.
pub(super) fn refine(
    structure: &Structure,
    points: &[Vector3<f64>],
    margin: f64,
    from: Interior,
    watch: &mut Watch,
) -> Result<Refined, FitError> {
    let known = points.iter().copied().chain(inner(structure));
    let values = DMatrix::from_columns(&known.map(|x| structure.values(&x)).collect::<Vec<_>>());
    let mut current = from;
    // What the solver left outside is taken in by the constant.
    let highest = values.tr_mul(&current.coefficients).max();
    current.coefficients[0] -= (highest - 1.0).max(0.0);
    let mut volumes = Vec::new();
    let mut last = None;
    let mut center = Vector3::zeros();
    let mut end = RefinementEnd::StepLimit;
    for _ in 0..MAX_VOLUME_STEPS {
        center = normalise(structure, &mut current, &center)?;
        let p = polynomial(structure, &current.coefficients)?;
        let model = expansion(structure, &p, &center);
        let here = model.volume;
        if volumes.is_empty() {
            volumes.push(here);
        }
        let program = step_model(structure, &current.coefficients, model, &center).ok_or(ProgramError::Singular)?;
        let path = Path::new(structure, &values, margin, PathObjective::Model(&program));
        watch.round(points.len(), 0.0);
        let Some((target, point)) = minimise(&path, here, last.take(), watch)? else {
            end = RefinementEnd::Unsolved;
            break;
        };
        last = Some(point);
        let Some((next, smaller)) = search(structure, &current, &target, &center, here) else {
            end = RefinementEnd::NoDescent;
            break;
        };
        volumes.push(smaller);
        current = next;
        if smaller > here * (1.0 - REFINED_VOLUME_DECREASE) {
            end = RefinementEnd::Converged;
            break;
        }
    }
    // The path ends a little inside the constraints: the constant takes that back, and then min p
    // is 0.
    current.coefficients[0] += 1.0 - values.tr_mul(&current.coefficients).max();
    normalise(structure, &mut current, &center)?;
    Ok(Refined { coefficients: current.coefficients, hessian: current.hessian, volumes, end })
}

/// The model that a step around these coefficients minimises; none where the volume has no usable
/// curvature.
pub(super) fn step_model(
    structure: &Structure,
    coefficients: &DVector<f64>,
    expansion: Expansion,
    center: &Vector3<f64>,
) -> Option<Model> {
    let Expansion { volume, gradient, mut curvature } = expansion;
    // A multiple of p - 1 describes the same set: a penalty on changes of p(center) fixes it.
    let at_center = structure.values(center);
    let mean = curvature.trace() / at_center.len() as f64;
    curvature.ger(volume * 10.0, &at_center, &at_center, 1.0);
    for i in 0..curvature.nrows() {
        curvature[(i, i)] += DAMPING * mean;
    }
    Model::new(coefficients.clone(), gradient, curvature)
}

/// `p -> 1 + (p - 1)/(1 - min p)`: the same set with min p = 0. Returns the minimiser.
pub(super) fn normalise(
    structure: &Structure,
    interior: &mut Interior,
    near: &Vector3<f64>,
) -> Result<Vector3<f64>, FitError> {
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

/// The minimiser of the model, to [`PATH_STEP_GAP`], and the dual point to start the next from.
fn minimise(
    path: &Path,
    volume: f64,
    warm: Option<DualPoint>,
    watch: &mut Watch,
) -> Result<Option<(Interior, DualPoint)>, FitError> {
    let gap = PATH_STEP_GAP * volume;
    let end = path.barrier_parameter() / gap;
    // The last optimum is close to the next, but also to the boundary: from there the path is not
    // always found.
    let warm = warm.map(|point| (DualPoint { tau: WARM * end, ..point }, WARM_STEPS));
    let cold = path.start().map(|point| (DualPoint { tau: COLD * end, ..point }, COLD_STEPS));
    for (start, steps) in warm.into_iter().chain(cold) {
        let centre = path.follow(start, PathOptions { gap, growth: GROWTH, steps }, watch)?;
        if let Some(centre) = centre.filter(|centre| centre.point.tau >= end) {
            return Ok(Some((centre.interior, centre.point)));
        }
    }
    Ok(None)
}

/// The polynomial on the way from `from` to `to` with about the smallest volume, if one is below
/// `here`.
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
