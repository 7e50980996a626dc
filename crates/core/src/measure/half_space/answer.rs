//! The signed distance from a half-space with its proof.

use super::set::HalfSpace;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::pairwise_minimum::bracketed;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// Signed distance of a body from a half-space with its proof; lengths in metres, vectors in the
/// world frame.
#[derive(Clone, Copy, Debug)]
pub struct HalfSpaceDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; negative values are depths.
    pub lower: f64,
    /// Proven upper bound, attained by the witness.
    pub upper: f64,
    /// The point of the body nearest to the half-space, or deepest in it.
    pub witness: Vector3<f64>,
    /// Whether another part may lie as low, their brackets meeting: witness and gradient may then
    /// jump. Of a capsule: its axis lies along the plane. Never for single bodies.
    pub tied: bool,
    /// Iterations.
    pub iterations: u32,
}

impl HalfSpaceDistance {
    /// The answer: the middle of the bracket.
    pub fn value(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// Gradient with respect to the pose the distance was asked for: `n` and `(x - t) × n`, x the
    /// witness; through contact and in depth as well. It is unique where the witness is.
    pub fn pose_gradient(&self, pose: &Pose, half_space: &HalfSpace) -> Twist {
        Twist::of_gradient(*half_space.normal(), &self.witness, pose.translation())
    }
}

bracketed!(HalfSpaceDistance);
