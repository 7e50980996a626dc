//! One conic program by clarabel.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
// Links the BLAS that clarabel's semidefinite cones call.
use openblas_src as _;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// `min cost·v` subject to `sides - entries v` in a product of cones, as `sublevel-bench accuracy`
/// writes it.
#[derive(Debug, Deserialize)]
pub(crate) struct Program {
    cost: Vec<f64>,
    entries: Vec<(usize, usize, f64)>,
    sides: Vec<f64>,
    nonnegative: usize,
    second_order: usize,
    semidefinite: Vec<usize>,
}

/// What came of it.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct Solved {
    /// Of setting up and solving.
    pub(crate) nanoseconds: f64,
    /// Middle of the primal and the dual cost.
    pub(crate) value: f64,
    /// Iterations of the interior-point method.
    pub(crate) iterations: u32,
    /// Whether clarabel says that it met the tolerance.
    pub(crate) solved: bool,
}

/// Solves it on one thread to this tolerance of the gap, absolute and relative, and of feasibility.
pub(crate) fn solve(program: &Program, tolerance: f64) -> Solved {
    let start = Instant::now();
    let count = program.cost.len();
    let column = |pick: fn(&(usize, usize, f64)) -> usize| program.entries.iter().map(pick).collect();
    let values = program.entries.iter().map(|entry| entry.2).collect();
    let (rows, columns): (Vec<usize>, Vec<usize>) = (column(|entry| entry.0), column(|entry| entry.1));
    let matrix = CscMatrix::new_from_triplets(program.sides.len(), count, rows, columns, values);
    let mut cones = vec![
        SupportedConeT::NonnegativeConeT(program.nonnegative),
        SupportedConeT::SecondOrderConeT(program.second_order),
    ];
    cones.extend(program.semidefinite.iter().map(|&size| SupportedConeT::PSDTriangleConeT(size)));
    let settings = DefaultSettings {
        verbose: false,
        max_threads: 1,
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        direct_solve_method: "faer".to_string(),
        // Moment matrices are dense: there is nothing to decompose.
        chordal_decomposition_enable: false,
        ..DefaultSettings::default()
    };
    let none = CscMatrix::zeros((count, count));
    let mut answer = Solved { nanoseconds: f64::NAN, value: f64::NAN, iterations: 0, solved: false };
    if let Ok(mut solver) = DefaultSolver::new(&none, &program.cost, &matrix, &program.sides, &cones, settings) {
        solver.solve();
        answer.value = 0.5 * (solver.solution.obj_val + solver.solution.obj_val_dual);
        answer.iterations = solver.solution.iterations;
        answer.solved = solver.solution.status == SolverStatus::Solved;
    }
    answer.nanoseconds = start.elapsed().as_nanos() as f64;
    answer
}
