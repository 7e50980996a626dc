//! Conic programs, and the one place that calls their solver.
//!
//! A [`ConicProgram`] is stated in affine expressions of its variables that are zero, nonnegative,
//! in a second-order cone or positive semidefinite; [`solve`] hands it to clarabel. Nothing that
//! comes out is trusted: who asked verifies bounds and certificates from the numbers alone.

mod program;
mod solve;

pub(crate) use program::{ConicProgram, Expression, geometric_mean};
#[cfg(test)]
pub(crate) use solve::alone;
pub(crate) use solve::{ConicSolution, solve};

#[cfg(test)]
mod tests;
