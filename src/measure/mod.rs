//! Measures between two posed bodies: Euclidean, signed, level and growth distance and penetration depth, each inside a
//! proven bracket.
//!
//! Every measure but the depth, which is the least of many convex programs, is one convex program. A warm start is
//! corrected by Newton's method on the optimality system of its active constraints (`newton`); where that does not apply or
//! does not converge, an interior-point method ([`crate::optimize`]) does, from a start that is always feasible. Neither is
//! trusted: an answer is accepted when its bracket, which holds for any trial point (`bracket`), is narrow enough. This room
//! knows neither clock nor allocator nor threads.

mod bracket;
mod distance;
mod growth;
mod level;
mod linear;
mod newton;
mod options;
mod pair;
mod penetration;
mod pose;
mod programs;
mod signed;
mod twist;
mod warm;

pub use distance::{Distance, distance};
pub use growth::{GrowthDistance, growth_distance};
pub use level::{LevelDistance, level_distance};
pub use options::{DEFAULT_ACCURACY, DEFAULT_DEPTH_ACCURACY, MAX_ITERATIONS, Options, OptionsError};
pub use penetration::{Penetration, penetration};
pub use pose::{Pose, PoseError};
pub use signed::{SignedDistance, signed_distance};
pub use twist::Twist;
pub use warm::WarmStart;

/// How a solve ended. The bracket is true in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The bracket is as narrow as asked for.
    Converged,
    /// The iteration limit, the stop flag or the rounding floor came first; the bracket says what is known.
    BracketWide,
}

#[cfg(test)]
mod tests;
