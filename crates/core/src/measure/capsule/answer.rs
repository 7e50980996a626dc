//! The signed distance of a capsule.

use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::pairwise_minimum::bracketed;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// Signed distance of a body from a capsule with its proof; lengths in metres, vectors in the world
/// frame.
#[derive(Clone, Copy, Debug)]
pub struct CapsuleDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; negative values are depths. Minus infinity where how deep they overlap
    /// is not measured: where the axis of the capsule meets a body that is no ball, and in solids
    /// of several parts.
    pub lower: f64,
    /// Proven upper bound.
    pub upper: f64,
    /// The point of the body nearest to the axis of the capsule.
    pub witness: Vector3<f64>,
    /// The point of the capsule nearest to the body, or deepest in it.
    pub witness_of_capsule: Vector3<f64>,
    /// Unit vector from the capsule to the body; none where the axis meets the body.
    pub normal: Option<Vector3<f64>>,
    /// Whether another part may be as near, their brackets meeting: witnesses and normal may then
    /// jump. Never for single bodies.
    pub tied: bool,
    /// Iterations.
    pub iterations: u32,
}

impl Default for CapsuleDistance {
    /// What is known of any solid and capsule: a place for an answer.
    fn default() -> Self {
        Self {
            status: Status::BracketWide,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            witness: Vector3::zeros(),
            witness_of_capsule: Vector3::zeros(),
            normal: None,
            tied: false,
            iterations: 0,
        }
    }
}

impl CapsuleDistance {
    /// The answer: the middle of the bracket, and where no depth is measured the upper bound.
    pub fn value(&self) -> f64 {
        if self.lower.is_finite() { 0.5 * (self.lower + self.upper) } else { self.upper }
    }

    /// Gradients with respect to the poses of the body and of the capsule that the distance was
    /// asked for; through contact and in depth as well, as long as the axis is outside of the body.
    /// By the envelope theorem the witnesses count as fixed.
    pub fn gradients(&self, pose: &Pose, capsule_pose: &Pose) -> Option<[Twist; 2]> {
        let n = self.normal?;
        Some([
            Twist::of_gradient(n, &self.witness, pose.translation()),
            Twist::of_gradient(-n, &self.witness_of_capsule, capsule_pose.translation()),
        ])
    }
}

bracketed!(CapsuleDistance);
