//! Answers about one set: levels in another, heights, distances from points.

use crate::measure::Status;
use nalgebra::Vector3;

/// A bracket of the level distance `d(A‖B) = min { max_i g_i(x) : x in B }`, the g those of A;
/// without unit. At most 1 exactly where the sets have a common point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetLevelDistance {
    /// Whether the bracket is as narrow as asked for, or the comparison decided.
    pub status: Status,
    /// Proven lower bound.
    pub lower: f64,
    /// Proven upper bound, attained by the point; ∞ if none was found.
    pub upper: f64,
    /// A point of B, common frame, metres.
    pub point: Option<Vector3<f64>>,
    /// Boxes that were divided.
    pub steps: usize,
}

/// A bracket of the signed distance `min normal·x - offset` of a set from a half-space, metres:
/// where it is negative, the depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetHeight {
    /// Whether the bracket is as narrow as asked for, or the comparison decided.
    pub status: Status,
    /// Proven lower bound.
    pub lower_m: f64,
    /// Proven upper bound, attained by the point; ∞ if none was found.
    pub upper_m: f64,
    /// The lowest point found, common frame, metres.
    pub point: Option<Vector3<f64>>,
    /// Boxes that were divided.
    pub steps: usize,
}

/// A bracket of the distance of a set from a point, metres; 0 inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPointDistance {
    /// Whether the bracket is as narrow as asked for, or the comparison decided.
    pub status: Status,
    /// Proven lower bound.
    pub lower_m: f64,
    /// Proven upper bound, attained by the point; 0 if it is proven inside, ∞ if none was found.
    pub upper_m: f64,
    /// The nearest point of the set that was found, common frame, metres.
    pub point: Option<Vector3<f64>>,
    /// Boxes that were divided.
    pub steps: usize,
}
