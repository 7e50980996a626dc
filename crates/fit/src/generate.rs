//! Solves the program of a fit: the central path to its optimum, adding the points that are left
//! outside.

use super::FitError;
use super::farthest_points::farthest_points;
use super::objective::Matrix;
use super::path::{Interior, Iterate, Path, PathOptions};
use super::program::{Problem, ProgramError};
use super::progress::Watch;
use super::spaced_points::spaced_points;
use super::structure::Structure;
use nalgebra::{DMatrix, DVector, Vector3};
use sublevel_core::body::fibonacci_lattice;

/// Excess of p over 1 up to which a point is left to the shift of the constant coefficient;
/// dimensionless.
///
/// The shift grows the volume by about as much. A larger value makes bodies larger than the
/// optimum; a smaller one takes more rounds than the solver is accurate for. Pinned by
/// `the_optimum_is_feasible_and_its_bound_holds`.
const VIOLATION: f64 = 1e-6;

/// Largest distance of f to its lower bound, relative to f (or 1, if that is more), of a fit;
/// dimensionless.
///
/// It is a promise of the reports. A larger value would weaken the promise; a smaller one refuses
/// fits that rounding keeps from it. Pinned by `objectives_are_optimal_and_proven`.
pub(super) const OPTIMALITY_GAP: f64 = 1e-5;

/// Distance to the optimum asked of the path, in units of log dets.
///
/// Well below [`OPTIMALITY_GAP`], so that fits pass it. A larger value fails that check; a smaller
/// one is not reached where rounding stops the path. Pinned by `objectives_are_optimal_and_proven`.
const FINE_GAP: f64 = 3e-7;

/// As [`FINE_GAP`], while points are still added: which points are outside hardly depends on the
/// last digits.
///
/// A larger value adds points that do not bound the optimum; a smaller one takes more Newton steps
/// in every round. It changes the time only, and no test fixes it.
const ROUGH_GAP: f64 = 1e-3;
/// Most rounds of adding points at the rough optimum, and the violation below which it does not
/// matter.
const PREPARATIONS: usize = 3;

/// Excess of p over 1 up to which the rough optimum needs no further points; dimensionless.
///
/// See [`PREPARATIONS`]. It changes how many rounds a fit takes and not its answer, which
/// [`VIOLATION`] decides.
const PREPARED: f64 = 1e-3;
/// Points in the start, in multiples of N, and the most that are taken for likely.
const START_MULTIPLE: usize = 10;
/// See [`START_MULTIPLE`].
const LIKELY_MULTIPLE: usize = 5;
/// Growth of τ from one centre to the next.
const GROWTH: f64 = 10.0;
/// Newton steps on one path before settling for what there is.
const MAX_PATH_STEPS: usize = 200;
/// Sets of points before giving up.
const MAX_POINT_ROUNDS: usize = 60;

/// The optimum of a fit's program, feasible for all points up to [`VIOLATION`].
#[derive(Clone, Debug)]
pub(super) struct Optimum {
    /// Coefficients of p on `Structure::monomials`.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form, and of what relaxes convexity.
    pub(super) hessian: DMatrix<f64>,
    /// Gram matrix of p, where it is measured.
    pub(super) gram: Option<DMatrix<f64>>,
    /// f minus its lower bound from the dual, if there is one; at most [`OPTIMALITY_GAP`] in
    /// proportion.
    pub(super) gap: Option<f64>,
    /// f, in the whitened frame for log dets and volumes and in the unit frame for traces.
    pub(super) objective: f64,
}

/// Minimises the objective over p, sos-convex as far as the problem asks for it, with `p <= 1` at
/// `points` (whitened: the unit ball is their smallest ellipsoid). The program begins with the
/// points that are `likely` to bound p, the likeliest first, among others; they change the answer
/// only within its gap.
pub(super) fn generate(
    problem: Problem,
    points: &[Vector3<f64>],
    likely: &[usize],
    watch: &mut Watch,
) -> Result<Optimum, FitError> {
    let structure = problem.structure;
    let mut active = Active::start(&problem, points, likely);
    let mut worst = 0.0;
    for round in 1..=MAX_POINT_ROUNDS {
        // Points come in while the optimum is still rough.
        let path = Path::of_fit(&problem, &active.values);
        let first = path.start().ok_or(ProgramError::Singular)?;
        watch.round(active.values.ncols(), worst);
        let rough = path.follow(first, path_options(ROUGH_GAP), watch)?.ok_or(ProgramError::Singular)?;
        let outside = violations(structure, points, &rough.interior.coefficients);
        worst = outside.first().map_or(0.0, |&(excess, _)| excess);
        if worst > PREPARED && round <= PREPARATIONS {
            active.add(structure, points, &outside);
            continue;
        }
        let last = path.follow(rough.point.clone(), path_options(FINE_GAP), watch)?.unwrap_or(rough);
        let outside = violations(structure, points, &last.interior.coefficients);
        worst = outside.first().map_or(0.0, |&(excess, _)| excess);
        if worst <= VIOLATION {
            return verified(&problem, last);
        }
        active.add(structure, points, &outside);
    }
    Err(FitError::NoConvergence { rounds: MAX_POINT_ROUNDS })
}

fn path_options(gap: f64) -> PathOptions {
    PathOptions { gap, growth: GROWTH, steps: MAX_PATH_STEPS }
}

/// The optimum if the dual point proves it one.
fn verified(problem: &Problem, centre: Iterate) -> Result<Optimum, FitError> {
    let gram = match problem.matrix {
        Matrix::Polynomial => centre.gram.as_ref(),
        Matrix::Hessian => Some(&centre.interior.hessian),
    };
    let objective = gram.and_then(|gram| problem.spectral.measure(gram)).ok_or(ProgramError::Singular)?;
    let gap = objective - problem.lower_bound(&centre.point.dual)?;
    if !(gap.abs() <= OPTIMALITY_GAP * objective.abs().max(1.0)) {
        return Err(FitError::NotOptimal { gap });
    }
    let Interior { coefficients, hessian } = centre.interior;
    Ok(Optimum { gap: Some(gap), objective, coefficients, hessian, gram: centre.gram })
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
    chosen: Vec<Vector3<f64>>,
    /// Monomials of each chosen point, one column each.
    values: DMatrix<f64>,
}

impl Active {
    /// A well-spread subset, the likeliest points, and for convex p some inside the hull: those
    /// constrain nothing, but with weight on them the moments are positive definite also when the
    /// points lie on a quadric, as the corners of a box do.
    fn start(problem: &Problem, points: &[Vector3<f64>], likely: &[usize]) -> Self {
        let structure = problem.structure;
        let first = farthest_points(points, START_MULTIPLE * structure.gram.size);
        let mut chosen: Vec<Vector3<f64>> = first.iter().map(|&index| points[index]).collect();
        if problem.is_convex() {
            chosen.extend(inner(structure));
        }
        let mut used = vec![false; points.len()];
        first.iter().for_each(|&index| used[index] = true);
        let unused = likely.iter().copied().filter(|&index| !used[index]);
        let likely = spaced_points(points, unused, LIKELY_MULTIPLE * structure.gram.size);
        likely.iter().for_each(|&index| used[index] = true);
        chosen.extend(likely.into_iter().map(|index| points[index]));
        let values = columns(structure, &chosen);
        Self { used, chosen, values }
    }

    /// Adds the worst of the points outside, but not many from one spot.
    fn add(&mut self, structure: &Structure, points: &[Vector3<f64>], outside: &[(f64, usize)]) {
        let candidates = outside.iter().map(|&(_, index)| index).filter(|&index| !self.used[index]);
        let added = spaced_points(points, candidates, 2 * structure.gram.size);
        added.iter().for_each(|&index| self.used[index] = true);
        self.chosen.extend(added.into_iter().map(|index| points[index]));
        self.values = columns(structure, &self.chosen);
    }
}

fn columns(structure: &Structure, points: &[Vector3<f64>]) -> DMatrix<f64> {
    DMatrix::from_columns(&points.iter().map(|point| structure.values(point)).collect::<Vec<_>>())
}

/// Points of a ball that is in the hull, twice as many as monomials of half the degree: they
/// constrain nothing, but with weight on them moments are positive definite also where there are
/// few points, or points on a quadric. The unit ball is the smallest ellipsoid around the hull, so
/// the ball of a third of its radius is inside (John's theorem).
pub(super) fn inner(structure: &Structure) -> impl Iterator<Item = Vector3<f64>> {
    let count = 2 * structure.gram.size;
    fibonacci_lattice(count).enumerate().map(|(i, u)| u * (INNER_RADIUS * (i as f64 * RADIUS_STEP).fract().cbrt()))
}

/// Radius of the ball, and the step of a low-discrepancy sequence of its radii.
const INNER_RADIUS: f64 = 0.33;
const RADIUS_STEP: f64 = 0.754_878;
