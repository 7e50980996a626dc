//! How much a run of this chart measures.

/// How much is run.
pub(super) struct Effort {
    pub(super) degrees: &'static [usize],
    pub(super) slabs: &'static [usize],
    pub(super) parts: &'static [usize],
    /// Poses of a batch, pairs of a message, points of a fit.
    pub(super) batches: &'static [usize],
    pub(super) messages: &'static [usize],
    pub(super) points: &'static [usize],
    pub(super) trajectories: usize,
    pub(super) poses: usize,
    pub(super) passes: usize,
}
