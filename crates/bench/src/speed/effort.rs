//! How much a run of this chart measures.

/// How much is run.
pub(super) struct Effort {
    pub(super) quick: bool,
    pub(super) trajectories: usize,
    pub(super) poses: usize,
    pub(super) passes: usize,
    /// Poses, about, and passes of what takes ten thousand times as long as the rest.
    pub(super) slow_poses: usize,
    pub(super) slow_passes: usize,
}
