//! One fit, and how it was made.

use sublevel::fit::{Cone, FitOptions, Solver};

/// How to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    Structured,
    Clarabel,
    Refined,
    Sdsos,
    Dsos,
}

impl Method {
    pub(super) const ALL: [Self; 5] = [Self::Structured, Self::Clarabel, Self::Refined, Self::Sdsos, Self::Dsos];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Structured => "structured",
            Self::Clarabel => "clarabel",
            Self::Refined => "refined",
            Self::Sdsos => "sdsos",
            Self::Dsos => "dsos",
        }
    }

    pub(super) fn options(self, degree: usize) -> FitOptions {
        let plain = FitOptions { degree, ..FitOptions::default() };
        match self {
            Self::Structured => FitOptions { solver: Some(Solver::Structured), ..plain },
            Self::Clarabel => FitOptions { solver: Some(Solver::Clarabel), ..plain },
            Self::Refined => FitOptions { refine: true, ..plain },
            Self::Sdsos => FitOptions { cone: Cone::Sdsos, ..plain },
            Self::Dsos => FitOptions { cone: Cone::Dsos, ..plain },
        }
    }
}

/// One fit.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fitting {
    pub(super) mesh: String,
    pub(super) vertices: usize,
    pub(super) method: String,
    pub(super) degree: usize,
    pub(super) seconds: f64,
    /// Volume of the body over that of the hull.
    pub(super) ratio: f64,
    /// None over the smaller cones, which have another objective.
    pub(super) objective: Option<f64>,
    pub(super) gap: Option<f64>,
    pub(super) rounds: usize,
    pub(super) iterations: usize,
}
