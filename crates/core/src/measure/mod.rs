#![doc = include_str!("textbook.md")]
//!
//! # Inside
//!
//! A warm start is corrected by Newton's method on the optimality system of its active constraints
//! (`newton`, and `smooth` where one constraint of each body is active); where that does not apply
//! or does not converge, an interior-point method ([`crate::optimize`]) does. Neither is trusted:
//! an answer is accepted when its bracket (`bracket`) is narrow enough. As that holds a normal to
//! about the root of its width only, the equations have to hold there, too. Unions are in `union`.
//! This room knows neither clock nor allocator nor threads.

mod active;
mod batch;
mod bracket;
mod curvature;
mod decide;
mod distance;
mod drift;
mod entry;
mod growth;
mod half_space;
mod impact;
mod level;
mod linear;
mod motion;
mod newton;
mod options;
mod outlines;
mod pair;
mod penetration;
mod point;
mod pose;
mod programs;
mod quadratic;
mod ray;
mod relation;
mod series;
mod sharp;
mod signed;
mod single;
mod smooth;
mod start;
mod sweep;
mod tangent;
mod twist;
mod twofold;
mod union;
mod vector;
mod warm;

pub use active::ActiveConstraints;
pub use batch::{BatchError, distance_batch};
pub use curvature::translation_hessian;
pub use decide::{Decision, ThresholdError, WithinMargin, nearer_than, overlap, within_margin};
pub use distance::{Distance, distance};
pub use growth::{GrowthDistance, growth_distance};
pub use half_space::{HalfSpace, HalfSpaceDistance, HalfSpaceError, distance_to_half_space};
pub use impact::{
    DEFAULT_CONTACT, Impact, ImpactOptions, ImpactOptionsError, ImpactStatus, MAX_QUERIES, time_of_impact,
};
pub use level::{LevelDistance, level_distance};
pub use motion::{Motion, MotionError};
pub use options::{DEFAULT_ACCURACY, DEFAULT_DEPTH_ACCURACY, MAX_ITERATIONS, Options, OptionsError};
pub use penetration::{Penetration, penetration};
pub use point::{PointDistance, PointError, distance_to_point};
pub use pose::{Pose, PoseError};
pub use ray::{Ray, RayCast, RayError, RayHit, cast_ray};
pub use signed::{SignedDistance, signed_distance};
pub use sweep::{Sweep, cast_ball};
pub use twist::Twist;
pub use warm::WarmStart;

/// How a solve ended. The bracket is true in every case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// The bracket is as narrow as asked for.
    Converged,
    /// The iteration limit, the stop flag or the rounding floor came first; the bracket says what
    /// is known.
    BracketWide,
}

#[cfg(test)]
mod tests;
