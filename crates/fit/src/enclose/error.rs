//! Why there is no body around sets.

use crate::error::FitError;
use crate::unsolved::ProgramError;
use sublevel_core::polynomial::NotContaining;

/// Most sets in one body.
pub const MAX_SETS: usize = 64;

/// Why there is no body around the sets.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EncloseError {
    /// No set or too many.
    #[error("sets: {0} given; between 1 and {MAX_SETS} can be enclosed in one body, group them in several")]
    Count(usize),
    /// A set without polynomials.
    #[error("sets[{0}] has no polynomial; it is the whole space, which no body contains")]
    NoPolynomial(usize),
    /// The degree of the multipliers is odd or too high.
    #[error("multiplier degree: {0} is not one of 0, 2, 4; leave it away unless the body is too large")]
    MultiplierDegree(usize),
    /// The growth that groups are allowed is no such number.
    #[error(
        "max growth: {0} is not positive; give the volume that grouping may add, such as 0.2 of that of all bodies"
    )]
    Growth(f64),
    /// A set's points do not determine a frame for it.
    #[error("sets[{index}]: its points cannot be used: {source}")]
    Points {
        /// Which set.
        index: usize,
        /// What is wrong with them.
        source: FitError,
    },
    /// The multipliers prove nothing about a set from where its points are.
    #[error(
        "sets[{0}]: its points do not lie in its interior, or are too few to span the polynomials of this degree; give more \
         points, all over the set"
    )]
    Start(usize),
    /// What goes wrong in fits to points, too.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// No multipliers were found.
    #[error(
        "clarabel found no body of degree {degree} with multipliers of degree {multiplier_degree} around {sets} set(s): {source}; {}",
        remedy(.source)
    )]
    Unsolved {
        /// Degree of the body.
        degree: usize,
        /// Least degree of the multipliers.
        multiplier_degree: usize,
        /// How many sets.
        sets: usize,
        /// What happened.
        source: ProgramError,
    },
    /// A containment could not be proven.
    #[error("sets[{index}] could not be proven inside: {source}; lower the degree of the body or of the multipliers")]
    Unproven {
        /// Which set.
        index: usize,
        /// Why the proof fails.
        source: NotContaining,
    },
}

/// What to do about a program that was not solved: of degrees that are too low there is no body.
fn remedy(why: &ProgramError) -> &'static str {
    match why {
        ProgramError::Infeasible | ProgramError::Unbounded => {
            "raise the degree of the multipliers, or that of the body"
        }
        _ => "lower the degree of the body or of the multipliers, or enclose fewer sets",
    }
}

impl EncloseError {
    /// The error of a single set, with the name of the set that it is among others.
    pub(super) fn of_set(self, index: usize) -> Self {
        match self {
            Self::NoPolynomial(_) => Self::NoPolynomial(index),
            Self::Points { source, .. } => Self::Points { index, source },
            Self::Start(_) => Self::Start(index),
            Self::Unproven { source, .. } => Self::Unproven { index, source },
            error => error,
        }
    }
}
