//! The amount of data of a catalogue.

use crate::store::job::JobKind;

/// Sizes of a catalogue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Bodies of every kind.
    pub bodies: usize,
    /// Bodies among them that are still to be proven.
    pub unproven_bodies: usize,
    /// Bodies among them that are not what was stored, as far as is known; they are not used.
    pub damaged_bodies: usize,
    /// Scenes and forks.
    pub scenes: usize,
    /// Jobs that have not ended, by kind, in the order of [`JobKind::ALL`].
    pub jobs: [JobCounts; JobKind::ALL.len()],
}

/// Jobs of one kind that have not ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobCounts {
    /// Those that wait for their turn.
    pub queued: usize,
    /// Those that are worked on.
    pub running: usize,
}
