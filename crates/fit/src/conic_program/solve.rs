//! The solver behind every conic program: clarabel (Goulart and Chen, arXiv 2405.12762).

use super::program::ConicProgram;
use crate::FitError;
use crate::progress::Watch;
use crate::unsolved::{ProgramError, Stop};
use clarabel::solver::{DefaultInfo, DefaultSettings, DefaultSolver, IPSolver, SolverStatus};
use nalgebra::{DMatrix, DVector};
// Links the BLAS that clarabel's semidefinite cones call.
use openblas_src as _;
use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::Range;
use std::sync::mpsc::sync_channel;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::Duration;
use sublevel_core::body::SolverStep;

/// Held while the solver runs: a serial OpenBLAS, as Debian's `libopenblas-serial-dev`, keeps its
/// workspace in static memory, and two solvers at once give each other's numbers.
static BLAS: Mutex<()> = Mutex::new(());

/// How long to wait for another solver before asking whether to continue.
const WAIT: Duration = Duration::from_millis(5);

/// Iterations at most; 10 to 40 are usual.
const MAX_CONIC_ITERATIONS: u32 = 100;

/// What the solver returned, true or not.
#[derive(Clone, Debug)]
pub(crate) struct ConicSolution {
    /// Value of each variable.
    pub(crate) variables: Vec<f64>,
    /// Multiplier of each row.
    pub(crate) multipliers: Vec<f64>,
    /// How it ended, if short of the tolerance asked for.
    pub(crate) stop: Option<Stop>,
}

impl ConicSolution {
    /// Values of some variables.
    pub(crate) fn values(&self, variables: Range<usize>) -> DVector<f64> {
        DVector::from_column_slice(&self.variables[variables])
    }

    /// Multipliers of some rows.
    pub(crate) fn multipliers(&self, rows: Range<usize>) -> DVector<f64> {
        DVector::from_column_slice(&self.multipliers[rows])
    }

    /// The multiplier of a semidefinite constraint.
    pub(crate) fn matrix_multiplier(&self, rows: Range<usize>, size: usize) -> DMatrix<f64> {
        let triangle = &self.multipliers[rows];
        DMatrix::from_fn(size, size, |i, j| {
            let (i, j) = (i.min(j), i.max(j));
            triangle[j * (j + 1) / 2 + i] * if i == j { 1.0 } else { FRAC_1_SQRT_2 }
        })
    }
}

/// Solves a program, one of the process at a time, to a tolerance of the gap (absolute and
/// relative) and of feasibility (relative). Each iteration is reported and can stop it, as can the
/// wait for another solver; what is called must not solve programs itself. `unit` is what a
/// relative gap of 1 is in the units of the report.
///
/// # Errors
/// [`FitError::Cancelled`]; [`ProgramError`] where the solver found the program infeasible or
/// unbounded, or refused its data, and for numbers that are not finite.
pub(crate) fn solve(
    program: &ConicProgram,
    tolerance: f64,
    unit: f64,
    watch: &mut Watch,
) -> Result<ConicSolution, FitError> {
    if !program.is_finite() {
        return Err(ProgramError::Solver("a number of the program is not finite").into());
    }
    let _alone = lock(watch)?;
    // The solver's callback must not borrow `watch`: the solver runs on a thread of its own, and
    // waits at every iteration until this one has reported it.
    let (report, reports) = sync_channel::<SolverStep>(0);
    let (answer, answers) = sync_channel::<()>(0);
    let answers = Mutex::new(answers);
    let (round, mut cancelled) = (watch.progress().round, false);
    let solved = std::thread::scope(|scope| {
        let worker = scope.spawn(move || {
            run(program, tolerance, move |info| {
                let step = SolverStep {
                    round,
                    iteration: info.iterations as usize,
                    primal: info.cost_primal,
                    dual: info.cost_dual,
                    primal_residual: info.res_primal,
                    dual_residual: info.res_dual,
                    step_length: info.step_length,
                };
                report.send(step).is_err() || !answers.lock().is_ok_and(|answers| answers.recv().is_ok())
            })
        });
        for step in reports {
            let scale = step.primal.abs().min(step.dual.abs()).max(1.0);
            if watch.solver_step(step, unit * (step.primal - step.dual).abs() / scale).is_err() {
                // Without an answer the solver ends.
                cancelled = true;
                break;
            }
            if answer.send(()).is_err() {
                break;
            }
        }
        drop(answer);
        worker.join()
    });
    if cancelled {
        return Err(FitError::Cancelled);
    }
    // A panic is one of the solver or of its BLAS about the numbers it met.
    solved.unwrap_or(Err(ProgramError::Solver("it panicked"))).map_err(FitError::from)
}

/// Waits for the solver, and meanwhile asks whether to continue.
fn lock(watch: &mut Watch) -> Result<MutexGuard<'static, ()>, FitError> {
    loop {
        match BLAS.try_lock() {
            Ok(guard) => return Ok(guard),
            // A panic while it was held leaves nothing that the next run needs.
            Err(TryLockError::Poisoned(poisoned)) => return Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => {
                watch.waiting()?;
                std::thread::sleep(WAIT);
            }
        }
    }
}

/// For tests that call clarabel themselves.
#[cfg(test)]
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    BLAS.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn run(
    program: &ConicProgram,
    tolerance: f64,
    callback: impl FnMut(&DefaultInfo<f64>) -> bool + Send + Sync + 'static,
) -> Result<ConicSolution, ProgramError> {
    let settings = DefaultSettings {
        verbose: false,
        max_iter: MAX_CONIC_ITERATIONS,
        max_threads: 1,
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        // Semidefinite cones make dense blocks, which faer factors several times faster; without
        // them QDLDL takes a quarter of its time (`dsos` at degree 8).
        direct_solve_method: if program.has_semidefinite() { "faer" } else { "qdldl" }.to_owned(),
        // The matrices are dense: there is nothing to decompose.
        chordal_decomposition_enable: false,
        ..DefaultSettings::default()
    };
    let (quadratic, linear, constraints, constants, cones) = program.standard();
    let mut solver = DefaultSolver::new(&quadratic, linear, &constraints, constants, cones, settings)
        .map_err(|error| ProgramError::Refused(error.to_string()))?;
    solver.set_termination_callback(callback);
    solver.solve();
    let solution = solver.solution;
    let status = solution.status;
    // How near the others are is for who asked to verify.
    match status {
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => return Err(ProgramError::Infeasible),
        SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => return Err(ProgramError::Unbounded),
        _ => {}
    }
    let finite = solution.x.iter().chain(&solution.z).all(|value| value.is_finite());
    if !finite {
        return Err(ProgramError::Solver(match stop(status) {
            Some(Stop::NumericalError) => "it met numerical errors, and its numbers are not finite",
            _ => "its numbers are not finite",
        }));
    }
    Ok(ConicSolution { variables: solution.x, multipliers: solution.z, stop: stop(status) })
}

/// How the solver ended, if short of its tolerance.
fn stop(status: SolverStatus) -> Option<Stop> {
    match status {
        SolverStatus::AlmostSolved => Some(Stop::Almost),
        SolverStatus::InsufficientProgress => Some(Stop::Stalled),
        SolverStatus::NumericalError => Some(Stop::NumericalError),
        SolverStatus::MaxIterations => Some(Stop::Iterations),
        _ => None,
    }
}
