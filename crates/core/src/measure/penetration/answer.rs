//! The penetration depth of two bodies with its proof.

use crate::measure::pairwise_minimum::Bracketed;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// Penetration depth with its proof, lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct Penetration {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound over all directions; 0 if the bodies are not proven to overlap.
    pub lower: f64,
    /// Proven upper bound: moving the first body by this much along `direction` (or the second
    /// against it) takes the bodies apart, so that they touch at most; 0 if they are apart.
    pub upper: f64,
    /// Unit vector from the second body to the first: the normal of the distance, continued; none
    /// if they are apart.
    pub direction: Option<Vector3<f64>>,
    /// Point of the first body that is deepest in the second: the last to come out.
    pub witness_a: Vector3<f64>,
    /// Point of the second body that is deepest in the first.
    pub witness_b: Vector3<f64>,
    /// Whether a direction elsewhere, or another pair of parts, was seen to be about as short, or
    /// the direction is not known to be the best of those near it: direction and witnesses may then
    /// jump.
    pub tied: bool,
    /// Directions whose support points were computed; 0 where a closed form answers.
    pub directions: u32,
    /// Iterations: sweeps over triangles, and steps of Newton's method.
    pub iterations: u32,
}

impl Penetration {
    /// The answer inside the bracket: the upper bound, which the direction attains.
    pub fn value(&self) -> f64 {
        self.upper
    }
}

/// A depth counts as a negative distance.
impl Bracketed for Penetration {
    fn bracket(&self) -> [f64; 2] {
        [-self.upper, -self.lower]
    }

    fn iterations(&self) -> u32 {
        self.iterations
    }
}
