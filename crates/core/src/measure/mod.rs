#![doc = include_str!("textbook.md")]
//!
//! # Inside
//!
//! Boxes, cylinders, balls and capsules have closed forms (`solver/exact_shape`). Otherwise a warm
//! start is corrected by Newton's method on the optimality system of its active constraints
//! (`solver/kkt_newton`, and `solver/continuation` where one constraint of each body is active);
//! where that does not apply or does not converge, an interior-point method ([`crate::optimize`])
//! takes over. No method's result is accepted by itself: an answer is accepted when its bracket
//! (`bounds`) is narrow enough. A bracket determines the normal to about the root of its width
//! only, so the optimality equations are checked as well. Solids of several parts are solved pair
//! by pair (`pairwise_minimum`), few of them, for trees bound the others (`part_pairs`). Imports go
//! one way: measures on `solver`, that on `bounds`, these on `frames`. Neither clock nor allocator
//! nor threads are used.

mod batch;
mod bounds;
mod capsule;
mod cast_ball;
mod cast_ray;
mod distance;
mod frames;
mod growth;
mod half_space;
mod level;
mod options;
mod other_parts;
mod overlap;
mod pairwise_minimum;
mod part_pairs;
mod penetration;
mod point;
mod signed;
mod solver;
mod status;
mod time_of_impact;
mod translation_hessian;
mod warm;

pub use batch::{
    BatchError, distance_batch, distance_to_capsule_batch, is_capsule_solved_in_lanes, is_solved_in_lanes,
};
pub use capsule::{
    Capsule, CapsuleDistance, CapsuleError, capsules_nearer_than, capsules_within_margin, distance_of_capsules,
    distance_to_capsule, nearer_to_capsule_than, overlap_of_capsules, overlap_with_capsule, within_margin_of_capsule,
};
pub use cast_ball::{Sweep, cast_ball};
pub use cast_ray::{Ray, RayCast, RayError, RayHit, cast_ray};
pub use distance::{Distance, distance};
pub use frames::motion::{Motion, MotionError};
pub use frames::pose::{Pose, PoseError};
pub use frames::twist::Twist;
pub use growth::{GrowthDistance, growth_distance};
pub use half_space::{
    HalfSpace, HalfSpaceDistance, HalfSpaceError, SignedThresholdError, capsule_nearer_to_half_space_than,
    distance_of_capsule_to_half_space, distance_to_half_space, nearer_to_half_space_than,
    overlap_of_capsule_with_half_space, overlap_with_half_space,
};
pub use level::{LevelDistance, level_distance};
pub use options::{DEFAULT_ACCURACY, DEFAULT_DEPTH_ACCURACY, MAX_ITERATIONS, Options, OptionsError};
pub use overlap::{Decision, ThresholdError, WithinMargin, nearer_than, overlap, within_margin};
pub use penetration::{Penetration, penetration};
pub use point::{PointDistance, PointError, distance_to_point};
pub use signed::{SignedDistance, signed_distance};
pub use solver::active_constraints::ActiveConstraints;
pub use status::Status;
pub use time_of_impact::{
    DEFAULT_CONTACT, Impact, ImpactOptions, ImpactOptionsError, ImpactStatus, MAX_QUERIES, time_of_impact,
};
pub use translation_hessian::translation_hessian;
pub use warm::WarmStart;

/// The stages of a search, which can be switched off to count what is lost without them.
#[cfg(feature = "ablation")]
pub mod stages {
    pub use super::solver::stages::{Stage, asked, except};
}

#[cfg(test)]
mod tests;
