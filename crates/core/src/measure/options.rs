//! What a caller asks of a solve: how narrow a bracket, how many iterations, and when to stop
//! early.

use std::sync::atomic::{AtomicBool, Ordering};

/// Default width of brackets: relative to the circumradius of the smaller body for lengths, to
/// `max(1, |d|)` for level distances; dimensionless.
///
/// Newton's method reaches it in the step after that of 1e-5. A larger value saves a step at most;
/// a smaller one meets the rounding floor of far poses. Exercised by
/// `random_pairs_converge_and_agree_in_all_ways`.
pub const DEFAULT_ACCURACY: f64 = 1e-9;

/// Default width of brackets of penetration depths, relative to the depth; dimensionless.
///
/// Depths are found by branch and bound, whose time grows as this shrinks; a larger value returns
/// directions that are visibly not the shortest. Exercised by
/// `ellipsoid_pairs_against_brute_force`.
pub const DEFAULT_DEPTH_ACCURACY: f64 = 1e-3;

/// Default and largest iteration limit: several times what the worst pairs of flat bodies met so
/// far need.
pub const MAX_ITERATIONS: u32 = 1000;

/// How a query is to be solved; checked when made, so that no solve starts with a request it cannot
/// serve.
///
/// ```
/// use sublevel_core::measure::Options;
///
/// let coarse = Options::default().with_accuracy(1e-3)?;
/// assert!(Options::default().with_accuracy(0.0).is_err());
/// # Ok::<(), sublevel_core::measure::OptionsError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Options<'a> {
    accuracy: f64,
    depth_accuracy: f64,
    max_iterations: u32,
    stop: Option<&'a AtomicBool>,
}

/// Why a request cannot be served.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum OptionsError {
    /// An accuracy that no bracket can meet, or that every bracket meets.
    #[error("accuracy {0} is not above 0 and at most 1; the default is 1e-9")]
    Accuracy(f64),
    /// An iteration limit out of range.
    #[error("iteration limit {0} is not between 1 and {MAX_ITERATIONS}")]
    Iterations(u32),
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self {
            accuracy: DEFAULT_ACCURACY,
            depth_accuracy: DEFAULT_DEPTH_ACCURACY,
            max_iterations: MAX_ITERATIONS,
            stop: None,
        }
    }
}

impl<'a> Options<'a> {
    /// The same with brackets at most this wide: relative to the circumradius of the smaller body
    /// for lengths, to `max(1, |d|)` for values without unit. Below the rounding floor no bracket
    /// gets, and the status says so: some 1e-13 of the larger body and of the distance between
    /// both, 1e-12 where surfaces are flat; for distances of bodies from points and from capsules,
    /// which go on in double-double arithmetic, a few spacings of doubles at the distance.
    ///
    /// # Errors
    /// An accuracy that is not above 0 and at most 1.
    pub fn with_accuracy(self, accuracy: f64) -> Result<Self, OptionsError> {
        if accuracy > 0.0 && accuracy <= 1.0 {
            Ok(Self { accuracy, ..self })
        } else {
            Err(OptionsError::Accuracy(accuracy))
        }
    }

    /// The same with brackets of penetration depths at most this wide, relative to the depth. A
    /// depth is the least over all directions: the proof costs more than the value, and more the
    /// nearer other directions come to the best. Where the depth is so small that `accuracy` asks
    /// for less, that is what counts.
    ///
    /// # Errors
    /// An accuracy that is not above 0 and at most 1.
    pub fn with_depth_accuracy(self, depth_accuracy: f64) -> Result<Self, OptionsError> {
        if depth_accuracy > 0.0 && depth_accuracy <= 1.0 {
            Ok(Self { depth_accuracy, ..self })
        } else {
            Err(OptionsError::Accuracy(depth_accuracy))
        }
    }

    /// The same with at most this many iterations of all methods together; what is known by then is
    /// the answer.
    ///
    /// # Errors
    /// A limit outside 1 to [`MAX_ITERATIONS`].
    pub fn with_max_iterations(self, max_iterations: u32) -> Result<Self, OptionsError> {
        if (1..=MAX_ITERATIONS).contains(&max_iterations) {
            Ok(Self { max_iterations, ..self })
        } else {
            Err(OptionsError::Iterations(max_iterations))
        }
    }

    /// The same with a flag that is looked at in every iteration; once it is set, what is known by
    /// then is the answer.
    pub fn with_stop(self, stop: &'a AtomicBool) -> Self {
        Self { stop: Some(stop), ..self }
    }

    /// Width of the brackets asked for.
    pub fn accuracy(&self) -> f64 {
        self.accuracy
    }

    /// Width of the brackets of penetration depths asked for, relative to the depth.
    pub fn depth_accuracy(&self) -> f64 {
        self.depth_accuracy
    }

    /// Most iterations of a solve.
    pub fn max_iterations(&self) -> u32 {
        self.max_iterations
    }

    /// What is left of the iterations after that many.
    pub(super) fn after(&self, iterations: u32) -> Self {
        Self { max_iterations: self.max_iterations.saturating_sub(iterations), ..*self }
    }

    /// Whether a solve that has taken this many iterations has to end.
    #[inline]
    pub(super) fn exhausted(&self, iterations: u32) -> bool {
        iterations >= self.max_iterations || self.stopped()
    }

    /// Whether the stop flag is set.
    #[inline(always)]
    pub(super) fn stopped(&self) -> bool {
        self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
    }
}
