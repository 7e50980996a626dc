//! How long, how near and how hard an impact is looked for.

use std::sync::atomic::AtomicBool;

/// Default distance that counts as contact, relative to the circumradius of the smaller solid;
/// dimensionless.
///
/// Larger, impacts are reported earlier by the time this distance takes; smaller, more queries are
/// needed and rounding of far motions stops them. Exercised by `random_motions_are_never_late`.
pub const DEFAULT_CONTACT: f64 = 1e-6;

/// Default and largest limit of distance queries for one pair of bodies.
pub const MAX_QUERIES: u32 = 1000;

/// Duration, contact distance and limit of a search for an impact; checked when made.
///
/// ```
/// use sublevel_core::measure::ImpactOptions;
///
/// let options = ImpactOptions::new(2.5)?.with_contact(1e-9)?;
/// assert!(ImpactOptions::new(-1.0).is_err());
/// # Ok::<(), sublevel_core::measure::ImpactOptionsError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct ImpactOptions<'a> {
    pub(super) duration: f64,
    pub(super) contact: f64,
    pub(super) max_queries: u32,
    pub(super) stop: Option<&'a AtomicBool>,
}

/// Why a request cannot be served.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ImpactOptionsError {
    /// A duration that is no time.
    #[error("duration {0} s is not a finite time of at least 0")]
    Duration(f64),
    /// A contact distance out of range.
    #[error(
        "contact distance {0} is not between 1e-12 and 1 (relative to the smaller circumradius); the default is 1e-6"
    )]
    Contact(f64),
    /// A limit out of range.
    #[error("query limit {0} is not between 1 and {MAX_QUERIES}")]
    Queries(u32),
}

impl<'a> ImpactOptions<'a> {
    /// Look from time 0 to `duration` seconds.
    ///
    /// # Errors
    /// A duration that is negative or not finite.
    pub fn new(duration: f64) -> Result<Self, ImpactOptionsError> {
        if duration >= 0.0 && duration.is_finite() {
            Ok(Self { duration, contact: DEFAULT_CONTACT, max_queries: MAX_QUERIES, stop: None })
        } else {
            Err(ImpactOptionsError::Duration(duration))
        }
    }

    /// The same with another distance that counts as contact, relative to the circumradius of the
    /// smaller solid.
    ///
    /// # Errors
    /// A distance outside 1e-12 to 1.
    pub fn with_contact(self, contact: f64) -> Result<Self, ImpactOptionsError> {
        if (1e-12..=1.0).contains(&contact) {
            Ok(Self { contact, ..self })
        } else {
            Err(ImpactOptionsError::Contact(contact))
        }
    }

    /// The same with at most this many distance and support queries for each pair of parts.
    ///
    /// # Errors
    /// A limit outside 1 to [`MAX_QUERIES`].
    pub fn with_max_queries(self, max_queries: u32) -> Result<Self, ImpactOptionsError> {
        if (1..=MAX_QUERIES).contains(&max_queries) {
            Ok(Self { max_queries, ..self })
        } else {
            Err(ImpactOptionsError::Queries(max_queries))
        }
    }

    /// The same with a flag that ends the search once it is set.
    pub fn with_stop(self, stop: &'a AtomicBool) -> Self {
        Self { stop: Some(stop), ..self }
    }
}
