//! When to stop dividing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Default number of pairs of boxes, or of boxes, that are divided: a few hundred milliseconds.
pub const DEFAULT_STEPS: usize = 100_000;

/// Steps that a comparison may take although the bracket is narrow: some milliseconds.
const STEPS_TO_DECIDE: usize = 4096;

/// Steps between two readings of the clock.
const STEPS_PER_LOOK: usize = 32;

/// When a bracket is narrow enough, and when to end before. Whatever ends it, the bracket is true.
#[derive(Clone, Copy, Debug)]
pub struct Limits<'a> {
    /// Width asked for, relative to the upper bound of a length; of a level, to `max(1, |upper|)`.
    pub accuracy: f64,
    /// Width asked for, in the unit of the measure; the wider of both counts.
    pub width: f64,
    /// A value to compare with: it ends as soon as the measure is proven above it, or not above.
    pub threshold: Option<f64>,
    /// A value that does not count when it is exceeded: it ends when the measure is proven above
    /// it.
    pub beyond: Option<f64>,
    /// Most divisions.
    pub max_steps: usize,
    /// Time at which it ends.
    pub deadline: Option<Instant>,
    /// It ends when this is set.
    pub stop: Option<&'a AtomicBool>,
}

impl Default for Limits<'_> {
    fn default() -> Self {
        Self {
            accuracy: 1e-2,
            width: 0.0,
            threshold: None,
            beyond: None,
            max_steps: DEFAULT_STEPS,
            deadline: None,
            stop: None,
        }
    }
}

impl Limits<'_> {
    /// Whether to end after this number of steps, whatever is known.
    pub(super) fn exhausted(&self, steps: usize) -> bool {
        steps >= self.max_steps
            || self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
            || steps.is_multiple_of(STEPS_PER_LOOK) && self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// Width that is narrow enough for a measure that is at most `upper` and of this scale.
    fn tolerance(&self, upper: f64, scale: f64) -> f64 {
        if upper.is_finite() { self.width.max(self.accuracy * upper.abs().max(scale)) } else { 0.0 }
    }

    /// Lower bound from which on a place need not be divided.
    pub(super) fn enough(&self, upper: f64, scale: f64) -> f64 {
        if self.threshold.is_some() { upper } else { upper - self.tolerance(upper, scale) }
    }

    /// Whether a bracket is narrow enough after this number of steps. What is compared with a
    /// threshold has to be decided, unless that takes too long.
    pub(super) fn narrow(&self, lower: f64, upper: f64, scale: f64, steps: usize) -> bool {
        let is_open = self.threshold.is_some() && steps < STEPS_TO_DECIDE;
        upper - lower <= self.tolerance(upper, scale) && !is_open
    }

    /// Whether the comparison with the threshold is decided, or the measure does not count.
    pub(super) fn decided(&self, lower: f64, upper: f64) -> bool {
        self.threshold.is_some_and(|threshold| lower > threshold || upper <= threshold)
            || self.beyond.is_some_and(|beyond| lower > beyond)
    }
}
