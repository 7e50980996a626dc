//! Solves the program of a fit by one of its solvers, adding the points that are left outside, and
//! verifies the optimum.

use super::FitError;
use super::active_points::ActivePoints;
use super::moment_program::{MomentOptimum, MomentProgram};
use super::objective::Matrix;
use super::path::{Interior, Path, PathOptions};
use super::program::Problem;
use super::progress::Watch;
use super::structure::Structure;
use super::unsolved::{Failure, Fault, ProgramError, Stop, Unsolved};
use nalgebra::{Cholesky, DMatrix, DVector, Vector3};
use sublevel_core::body::Solver;

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
/// Growth of τ from one centre to the next.
const GROWTH: f64 = 10.0;
/// Newton steps on one path before settling for what there is.
const MAX_PATH_STEPS: usize = 200;
/// Hull vertices up to which the conic solver is given all at once; above, those that were left
/// outside come in by rounds.
const ALL_POINTS: usize = 1000;
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
    /// What solved it.
    pub(super) solver: Solver,
    /// Why the solver that was tried before did not, if one was.
    pub(super) fallback: Option<String>,
}

/// An optimum by one of the solvers' own account.
struct Candidate {
    interior: Interior,
    gram: Option<DMatrix<f64>>,
    lower_bound: f64,
    /// How clarabel ended, if short of its tolerance.
    stop: Option<Stop>,
}

/// Minimises the objective over p, sos-convex as far as the problem asks for it, with `p <= 1` at
/// `points` (whitened: the unit ball is their smallest ellipsoid). The program begins with the
/// points that are `likely` to bound p, the likeliest first, among others; they change the answer
/// only within its gap. Unless one solver is asked for, a second one is tried where the first
/// fails.
pub(super) fn generate(
    problem: &Problem,
    points: &[Vector3<f64>],
    likely: &[usize],
    watch: &mut Watch,
) -> Result<Optimum, FitError> {
    let mut failures: Vec<Failure> = Vec::new();
    let solvers = problem.solvers();
    for &solver in &solvers {
        let found = match solver {
            Solver::Clarabel => by_conic_solver(problem, points, likely, watch),
            Solver::Structured => by_path(problem, points, likely, watch),
        };
        let is_last = solvers.last() == Some(&solver);
        let why = match found.and_then(|candidate| verified(problem, candidate, solver, is_last)) {
            Ok(optimum) => {
                let fallback = failures.pop().map(|Failure { solver, why, .. }| format!("{solver} failed: {why}"));
                return Ok(Optimum { fallback, ..optimum });
            }
            Err(FitError::Program(why)) => why,
            Err(error) => return Err(error),
        };
        failures.push(Failure { solver, points: watch.progress().active_points, why });
    }
    let (degree, is_solver_fixed) = (problem.structure.degree, problem.is_solver_fixed());
    Err(FitError::Unsolved(Unsolved { degree, failures, is_solver_fixed }))
}

/// Whether H is definite by half of the margin: of what the certificate has to prove, rounding
/// takes its part. A larger margin may help where no other solver does.
fn is_certifiable(problem: &Problem, hessian: &DMatrix<f64>) -> bool {
    let rows = hessian.nrows();
    let margin = DMatrix::identity(rows, rows) * (0.5 * problem.margin);
    rows == 0 || Cholesky::new(hessian - margin).is_some()
}

/// The optimum by clarabel.
fn by_conic_solver(
    problem: &Problem,
    points: &[Vector3<f64>],
    likely: &[usize],
    watch: &mut Watch,
) -> Result<Candidate, FitError> {
    let mut active = ActivePoints::start_with_all(problem, points, likely, ALL_POINTS);
    let mut worst = 0.0;
    for _ in 1..=MAX_POINT_ROUNDS {
        watch.round(active.values.ncols(), worst);
        let optimum = MomentProgram::of_points(problem, &active.values).solve(watch)?;
        let outside = violations(problem.structure, points, &optimum.interior.coefficients);
        worst = outside.first().map_or(0.0, |&(excess, _)| excess);
        if worst <= VIOLATION {
            let MomentOptimum { interior, gram, lower_bound, stop, .. } = optimum;
            return Ok(Candidate { interior, gram: Some(gram), lower_bound, stop });
        }
        if points.len() <= ALL_POINTS {
            return Err(ProgramError::Unusable { stop: optimum.stop, fault: Fault::Outside(worst) }.into());
        }
        active.add(problem.structure, points, &outside);
    }
    Err(ProgramError::Rounds(MAX_POINT_ROUNDS).into())
}

/// The optimum by the central path of the dual.
fn by_path(
    problem: &Problem,
    points: &[Vector3<f64>],
    likely: &[usize],
    watch: &mut Watch,
) -> Result<Candidate, FitError> {
    let structure = problem.structure;
    let mut active = ActivePoints::start(problem, points, likely);
    let mut worst = 0.0;
    for round in 1..=MAX_POINT_ROUNDS {
        // Points come in while the optimum is still rough.
        let path = Path::of_fit(problem, &active.values);
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
            let lower_bound = problem.lower_bound(&last.point.dual)?;
            return Ok(Candidate { interior: last.interior, gram: last.gram, lower_bound, stop: None });
        }
        active.add(structure, points, &outside);
    }
    Err(ProgramError::Rounds(MAX_POINT_ROUNDS).into())
}

fn path_options(gap: f64) -> PathOptions {
    PathOptions { gap, growth: GROWTH, steps: MAX_PATH_STEPS }
}

/// The optimum if the dual point proves it one, and unless it is the last solver's if a certificate
/// can be made of it.
fn verified(problem: &Problem, candidate: Candidate, solver: Solver, is_last: bool) -> Result<Optimum, FitError> {
    let Candidate { interior, gram, lower_bound, stop } = candidate;
    let measured = match problem.matrix {
        Matrix::Polynomial => gram.as_ref(),
        Matrix::Hessian => Some(&interior.hessian),
    };
    let objective = measured.and_then(|gram| problem.spectral.measure(gram)).ok_or(ProgramError::singular(stop))?;
    let gap = objective - lower_bound;
    if !(gap.abs() <= OPTIMALITY_GAP * objective.abs().max(1.0)) {
        return Err(ProgramError::Unusable { stop, fault: Fault::Gap(gap) }.into());
    }
    let Interior { coefficients, hessian } = interior;
    if !is_last && !is_certifiable(problem, &hessian) {
        return Err(ProgramError::Unusable { stop, fault: Fault::Indefinite }.into());
    }
    Ok(Optimum { gap: Some(gap), objective, coefficients, hessian, gram, solver, fallback: None })
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
