//! How a solve ended.

/// How a solve ended. The bracket is true in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The bracket is as narrow as asked for.
    Converged,
    /// The iteration limit, the stop flag or the rounding floor came first; the bracket says what
    /// is known.
    BracketWide,
}

impl Status {
    /// By whether the bracket is as narrow as asked for.
    pub(super) fn of(narrow: bool) -> Self {
        if narrow { Self::Converged } else { Self::BracketWide }
    }
}
