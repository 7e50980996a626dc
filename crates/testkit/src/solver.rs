//! Which solver of fits is under test.

use sublevel_core::body::Solver;

/// The solver that tests of fits take where they leave the choice open and there is one: that of
/// `SUBLEVEL_TEST_SOLVER` (`make solvers`).
///
/// # Panics
/// If the variable names no solver.
pub fn solver_under_test() -> Option<Solver> {
    let name = std::env::var("SUBLEVEL_TEST_SOLVER").ok()?;
    Some(name.parse().expect("SUBLEVEL_TEST_SOLVER names a solver"))
}
