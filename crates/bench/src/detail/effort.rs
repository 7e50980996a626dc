//! How much a run of this chart measures.

/// How much is run.
pub(super) struct Effort {
    pub(super) quick: bool,
    pub(super) trajectories: usize,
    pub(super) poses: usize,
    pub(super) passes: usize,
    /// Random pairs of poses per threshold.
    pub(super) questions: usize,
}
