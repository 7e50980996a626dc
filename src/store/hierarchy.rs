//! What a solve of the hierarchy is asked for, and what it found, as both are kept: JSON.

use serde::{Deserialize, Serialize};

use super::pose_row;
use crate::body::BodyId;
use crate::measure::Pose;

/// What a solve of the hierarchy is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HierarchyRequest {
    /// What is bracketed.
    pub measure: HierarchyMeasure,
    /// The two sets, A first.
    pub sets: [HierarchySet; 2],
    /// Level of the hierarchy.
    pub level: usize,
}

/// What can be bracketed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HierarchyMeasure {
    /// Euclidean distance, metres.
    #[default]
    Distance,
    /// Level distance d(A‖B), dimensionless.
    LevelAOnB,
}

/// A stored set at a pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HierarchySet {
    /// A body or an sos-body.
    pub body: BodyId,
    /// Body frame to world frame.
    #[serde(with = "pose_row")]
    pub pose: Pose,
}

/// The bracket that a solve has proven, and what that took. Bounds have the unit of the measure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HierarchyOutcome {
    /// Proven lower bound.
    pub lower: f64,
    /// Value at two points that are proven to lie in the sets, or at one of B, if such were found.
    pub upper: Option<f64>,
    /// These points, world frame, metres; the one of B twice.
    pub points_m: Option<[[f64; 3]; 2]>,
    /// Whether the lower bound is the value, to the accuracy of the solver.
    pub is_exact: bool,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Wall time of the solve.
    pub seconds: f64,
}
