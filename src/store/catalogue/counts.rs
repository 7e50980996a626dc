//! How much a catalogue holds.

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
}
