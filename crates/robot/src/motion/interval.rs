//! Pieces of a path that halving makes.

use serde::{Deserialize, Serialize};

/// Most halvings of a segment: beyond, its middle would no longer be exact.
pub(crate) const MAX_HALVINGS: u8 = 50;

/// A part of one segment of a path: `index / 2^halvings <= t <= (index + 1) / 2^halvings`, t in
/// [0, 1] over the segment. All of these are exact numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Interval {
    pub(crate) segment: u32,
    pub(crate) halvings: u8,
    pub(crate) index: u64,
}

impl Interval {
    /// A whole segment.
    pub(crate) fn whole(segment: u32) -> Self {
        Self { segment, halvings: 0, index: 0 }
    }

    pub(crate) fn start(&self) -> f64 {
        self.index as f64 * self.width()
    }

    pub(crate) fn end(&self) -> f64 {
        (self.index + 1) as f64 * self.width()
    }

    pub(crate) fn middle(&self) -> f64 {
        (self.index as f64 + 0.5) * self.width()
    }

    pub(crate) fn half_width(&self) -> f64 {
        0.5 * self.width()
    }

    fn width(&self) -> f64 {
        (-f64::from(self.halvings)).exp2()
    }

    /// Both halves; none where they would not be exact.
    pub(crate) fn halves(&self) -> Option<[Self; 2]> {
        let halvings = self.halvings + 1;
        let half = |index: u64| Self { halvings, index, ..*self };
        (halvings < MAX_HALVINGS).then(|| [half(2 * self.index), half(2 * self.index + 1)])
    }

    /// Whether it is a part of a segment of a path with so many, and has a middle.
    pub(crate) fn is_usable(&self, segments: usize) -> bool {
        (self.segment as usize) < segments && self.halvings < MAX_HALVINGS && self.index < 1 << self.halvings
    }
}
