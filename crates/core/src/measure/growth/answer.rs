//! The growth distance of two bodies with its proof.

use crate::measure::frames::twist::Twist;
use crate::measure::pairwise_minimum::bracketed;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// Growth distance with its proof; unit-free, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct GrowthDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound.
    pub lower: f64,
    /// Proven upper bound, attained by the witness.
    pub upper: f64,
    /// A point of both bodies grown by `upper`, metres: where they touch.
    pub witness: Vector3<f64>,
    /// Unit normal of the contact, from the second body to the first; none if the centres coincide
    /// up to rounding.
    pub normal: Option<Vector3<f64>>,
    /// Derivatives with respect to the twists of the first and of the second body (1/m and 1/rad),
    /// one of them where they are not unique; none if the centres coincide up to rounding.
    pub gradients: Option<[Twist; 2]>,
    /// Whether another pair of parts may be as soon to touch, their brackets meeting: normal,
    /// witness and gradients may then jump. Never for single bodies.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl GrowthDistance {
    /// The answer inside the bracket: the upper bound, which the witness attains.
    pub fn value(&self) -> f64 {
        self.upper
    }
}

bracketed!(GrowthDistance);
