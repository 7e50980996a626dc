//! The first contact, as it is answered.

use crate::measure::distance::Distance;

/// How a search for an impact ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImpactStatus {
    /// Proven apart all the time.
    Apart,
    /// Within the contact distance at `time`, and proven apart at all times before.
    Contact,
    /// The query limit, the stop flag or rounding came first: proven apart up to `time`, open
    /// after.
    Stopped,
}

/// The first contact of two moving solids, or the proof that there is none.
#[derive(Clone, Copy, Debug)]
pub struct Impact {
    /// How the search ended.
    pub status: ImpactStatus,
    /// At all times from 0 to before this one, seconds, the distance is proven to exceed half the
    /// contact distance.
    pub time: f64,
    /// The distance at that time: at most the contact distance on contact; none where nothing was
    /// in reach.
    pub distance: Option<Distance>,
    /// Distance queries and evaluations of a separating plane, together.
    pub queries: u32,
}
