//! Poses of a batch in lanes, and those that wait for a round.

use crate::polynomial::{Aligned, MAX_SINGLES};
use std::ops::Range;

/// Most lanes of them.
pub(super) const MAX_COARSE: usize = 2 * MAX_SINGLES;

/// Poses of the batch in lanes.
pub(super) struct Group<const LANES: usize> {
    /// Lanes in use.
    pub(super) count: usize,
    /// Index of the pose.
    pub(super) pose: [usize; LANES],
    /// Rounds that are behind it.
    pub(super) rounds: [u32; LANES],
    /// Coordinates of x, y and n.
    pub(super) at: Aligned<[[f64; LANES]; 9]>,
}

impl<const LANES: usize> Group<LANES> {
    /// Poses that nothing is known of yet; lanes to spare solve the last one once more.
    #[inline(always)]
    pub(super) fn fresh(poses: Range<usize>) -> Self {
        let pose = std::array::from_fn(|lane| (poses.start + lane).min(poses.end - 1));
        Self { count: poses.len(), pose, rounds: [0; LANES], at: Aligned([[0.0; LANES]; 9]) }
    }
}

/// Most poses that wait for one kind of round: one too few for a group, and those of a whole one.
pub(super) const MOST_WAITING: usize = 2 * MAX_COARSE;

/// Poses that wait for a round.
pub(super) struct Waiting {
    pub(super) len: usize,
    pub(super) pose: [usize; MOST_WAITING],
    pub(super) rounds: [u32; MOST_WAITING],
    pub(super) at: [[f64; MOST_WAITING]; 9],
}

impl Waiting {
    pub(super) fn none() -> Self {
        Self { len: 0, pose: [0; MOST_WAITING], rounds: [0; MOST_WAITING], at: [[0.0; MOST_WAITING]; 9] }
    }

    /// Lets a lane of a group wait.
    #[inline(always)]
    pub(super) fn push<const LANES: usize>(&mut self, group: &Group<LANES>, lane: usize) {
        self.pose[self.len] = group.pose[lane];
        self.rounds[self.len] = group.rounds[lane];
        for (waiting, column) in self.at.iter_mut().zip(&group.at.0) {
            waiting[self.len] = column[lane];
        }
        self.len += 1;
    }

    /// At most `lanes` of the last entries as a group; spare lanes carry some that no longer wait.
    #[inline(always)]
    pub(super) fn take<const LANES: usize>(&mut self, lanes: usize) -> Group<LANES> {
        let count = lanes.min(self.len);
        self.len -= count;
        let taken = self.len..self.len + lanes;
        let mut group = Group { count, pose: [0; LANES], rounds: [0; LANES], at: Aligned([[0.0; LANES]; 9]) };
        group.pose[..lanes].copy_from_slice(&self.pose[taken.clone()]);
        group.rounds[..lanes].copy_from_slice(&self.rounds[taken.clone()]);
        for (column, waiting) in group.at.0.iter_mut().zip(&self.at) {
            column[..lanes].copy_from_slice(&waiting[taken.clone()]);
        }
        group
    }
}
