//! How much a run of this chart measures.

/// How much is run.
pub(super) struct Effort {
    /// Of the pairs of objects, and at these degrees.
    pub(super) pairs: usize,
    pub(super) degrees: &'static [usize],
    /// Random poses of a case; those of them that hulls, and semidefinite programs, are asked
    /// about.
    pub(super) queries: usize,
    pub(super) few: usize,
    pub(super) programs: usize,
    /// Boundary points of hulls.
    pub(super) points: &'static [usize],
    pub(super) passes: usize,
}
