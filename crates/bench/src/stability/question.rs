//! One query of a family, and what came of it.

use crate::comparison::PeerError;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Deref;
use sublevel::measure::OptionsError;
use sublevel_testkit::catalogue::Case;

/// A case of the catalogue that is put to methods.
#[derive(Clone, Debug)]
pub(super) struct Question(pub(super) Case);

impl Deref for Question {
    type Target = Case;

    fn deref(&self) -> &Case {
        &self.0
    }
}

/// What came of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Verdict {
    /// As it should be.
    Pass,
    /// The answer is off by this much: in units of the smaller body, or whatever the family
    /// compares.
    Off(f64),
    /// It claims to be what it is not.
    WrongStatus(String),
    /// It says that there is no answer.
    NoAnswer,
    /// It took longer than the limit, and was stopped.
    Hang,
    /// It ended its process by a signal or a panic.
    Crash,
}

impl Verdict {
    /// What it is in a word or two.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Off(_) => "off",
            Self::WrongStatus(_) => "wrong status",
            Self::NoAnswer => "no answer",
            Self::Hang => "hang",
            Self::Crash => "crash",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pass => f.write_str("passes"),
            Self::Off(error) => write!(f, "off by {error:.1e}"),
            Self::WrongStatus(what) => write!(f, "wrong status: {what}"),
            Self::NoAnswer => f.write_str("no answer"),
            Self::Hang => f.write_str("hangs"),
            Self::Crash => f.write_str("crashes"),
        }
    }
}

/// Why a case cannot even be put.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum CaseError {
    /// Options of a query.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A peer's program crashed, which is a verdict on it.
    #[error("{0}")]
    Crashed(String),
    /// What else there is.
    #[error("{0}")]
    Other(String),
}

impl CaseError {
    /// An error that says enough by its words.
    pub(super) fn other(error: impl std::error::Error) -> Self {
        Self::Other(error.to_string())
    }
}

impl From<PeerError> for CaseError {
    fn from(error: PeerError) -> Self {
        match error {
            PeerError::Crashed { .. } => Self::Crashed(error.to_string()),
            PeerError::NoProgram { .. } | PeerError::Io { .. } | PeerError::Program { .. } => Self::other(error),
        }
    }
}
