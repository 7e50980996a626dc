//! What waits to be divided, in the order of lower bounds.

use std::cmp::Ordering;

/// A cell or a pair of cells with a lower bound of what is minimised.
pub(super) struct Waiting<T> {
    pub(super) lower: f64,
    pub(super) place: T,
}

impl<T> PartialEq for Waiting<T> {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl<T> Eq for Waiting<T> {}

impl<T> PartialOrd for Waiting<T> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<T> Ord for Waiting<T> {
    /// The lowest is the greatest: it is the next of a [`std::collections::BinaryHeap`].
    fn cmp(&self, other: &Self) -> Ordering {
        other.lower.total_cmp(&self.lower)
    }
}
