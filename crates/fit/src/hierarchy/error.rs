//! Why there is no bracket.

use crate::error::FitError;
use crate::unsolved::ProgramError;

/// Highest level that can be asked for: the next one has a matrix of 210 rows for both points
/// alone.
pub const MAX_LEVEL: usize = 2;

/// Rows of the triangles of all matrices up to which a program is built.
pub(super) const MAX_ROWS: usize = 8000;

/// Why the hierarchy has no bracket.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HierarchyError {
    /// A set without polynomials.
    #[error("sets[{0}] has no polynomial; it is the whole space")]
    NoPolynomial(usize),
    /// Numbers that are not finite, a map that cannot be inverted, or bounds that contain nothing.
    #[error("sets[{index}]: {why}")]
    Set {
        /// Which set.
        index: usize,
        /// What is wrong with it.
        why: &'static str,
    },
    /// Too high a level.
    #[error("level: {0} is not between 0 and {MAX_LEVEL}; every level takes several times as long as the one before")]
    Level(usize),
    /// Too large a program.
    #[error(
        "level: at level {level} the matrices of the program have {rows} entries, more than the {MAX_ROWS} that are solved in minutes; \
         lower the level, or the degree of the sets"
    )]
    TooLarge {
        /// The level.
        level: usize,
        /// Entries of the triangles of all matrices.
        rows: usize,
    },
    /// No functional is what points of the sets would be.
    #[error("sets: at least one is empty: no point of it satisfies all constraints; send sets that have points")]
    Empty,
    /// The program was not solved.
    #[error(
        "level: clarabel did not solve the program of level {level}, whose matrices have {rows} entries: {why}; {}",
        remedy(*.level)
    )]
    Unsolved {
        /// The level.
        level: usize,
        /// Entries of the triangles of all matrices.
        rows: usize,
        /// What happened.
        why: ProgramError,
    },
    /// The solve was cancelled.
    #[error(transparent)]
    Fit(#[from] FitError),
}

fn remedy(level: usize) -> &'static str {
    if level > 0 {
        "lower the level, or the degree of the sets"
    } else {
        "lower the degree of the sets, or raise the level"
    }
}
