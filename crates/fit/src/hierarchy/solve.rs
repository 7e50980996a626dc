//! What both measures check, and the solve of their programs.

use super::error::{HierarchyError, MAX_LEVEL, MAX_ROWS};
use super::moments::{MomentRelaxation, Rows};
use super::placed_set::PlacedSet;
use crate::conic_program::{ConicSolution, solve};
use crate::error::FitError;
use crate::progress::Watch;
use crate::unsolved::ProgramError;

/// Width of a bracket, relative to the size of the sets or to a level, at which its lower bound is
/// called exact.
pub(super) const EXACT: f64 = 1e-5;

/// Tolerance asked of the solver; what it leaves is part of the bound.
const TOLERANCE: f64 = 1e-9;

/// Refuses levels and sets that cannot be used.
pub(super) fn check(sets: [&PlacedSet; 2], level: usize) -> Result<(), HierarchyError> {
    if level > MAX_LEVEL {
        return Err(HierarchyError::Level(level));
    }
    sets.iter().enumerate().try_for_each(|(index, set)| set.check(index))
}

/// Refuses programs that would be too large.
pub(super) fn check_size(relaxation: &MomentRelaxation, level: usize) -> Result<(), HierarchyError> {
    let rows = relaxation.rows();
    if rows > MAX_ROWS { Err(HierarchyError::TooLarge { level, rows }) } else { Ok(()) }
}

/// Solves a program that is not too large.
pub(super) fn solved(
    relaxation: &MomentRelaxation,
    level: usize,
    watch: &mut Watch,
) -> Result<(ConicSolution, Rows), HierarchyError> {
    check_size(relaxation, level)?;
    watch.round(0, 0.0);
    let (program, rows) = relaxation.program();
    let solution = solve(&program, TOLERANCE, relaxation.unit(), watch).map_err(|error| match error {
        FitError::Program(ProgramError::Infeasible) => HierarchyError::Empty,
        FitError::Program(why) => HierarchyError::Unsolved { level, rows: relaxation.rows(), why },
        error => error.into(),
    })?;
    Ok((solution, rows))
}
