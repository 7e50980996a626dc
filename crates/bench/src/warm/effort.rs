//! How much a run of this chart measures.

/// How much is run.
pub(super) struct Effort {
    pub(super) trajectories: usize,
    pub(super) poses: usize,
    pub(super) passes: usize,
    /// Positions of the chair.
    pub(super) positions: usize,
}
