//! What solves the semidefinite program of a fit, and its iterations.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The solver of a fit's semidefinite program. Both solve the same program to the same accuracy,
/// and every body is proven from its own numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// The conic solver clarabel: every objective and degree.
    Clarabel,
    /// The central path of the dual in its own variables, for log det P only: faster at degree 8.
    Structured,
}

/// One iteration of clarabel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverStep {
    /// Which program of the fit, counted from 1.
    pub round: usize,
    /// Iteration of that program, counted from 0.
    pub iteration: usize,
    /// Value of its objective.
    pub primal: f64,
    /// Value of its dual objective.
    pub dual: f64,
    /// Relative residual of its constraints.
    pub primal_residual: f64,
    /// Relative residual of the constraints of the dual.
    pub dual_residual: f64,
    /// Length of the step before, 0 to 1.
    pub step_length: f64,
}

/// A name that is no solver.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("solver: {0:?} is not one of clarabel, structured; leave it out, and the faster one is taken")]
pub struct UnknownSolver(pub String);

impl Solver {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Clarabel, Self::Structured];

    /// Name on the command line, in reports, in stored requests and in the provenance of bodies.
    pub fn name(self) -> &'static str {
        match self {
            Self::Clarabel => "clarabel",
            Self::Structured => "structured",
        }
    }
}

impl fmt::Display for Solver {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Solver {
    type Err = UnknownSolver;

    fn from_str(name: &str) -> Result<Self, UnknownSolver> {
        Self::ALL.into_iter().find(|solver| solver.name() == name).ok_or_else(|| UnknownSolver(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for solver in Solver::ALL {
            assert_eq!(solver.to_string().parse(), Ok(solver));
            assert_eq!(serde_json::to_string(&solver).unwrap(), format!("{:?}", solver.name()));
        }
        assert!("mosek".parse::<Solver>().unwrap_err().to_string().contains("clarabel"));
    }
}
