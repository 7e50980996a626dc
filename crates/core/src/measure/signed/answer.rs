//! The signed distance of two bodies with its proof.

use crate::measure::frames::twist::Twist;
use crate::measure::pairwise_minimum::bracketed;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// Signed distance with its proof, lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct SignedDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; negative when the bodies may overlap.
    pub lower: f64,
    /// Proven upper bound; negative when the bodies are proven to overlap.
    pub upper: f64,
    /// Point of the first body nearest to the second, or deepest in it.
    pub witness_a: Vector3<f64>,
    /// Point of the second body nearest to the first, or deepest in it.
    pub witness_b: Vector3<f64>,
    /// Unit vector from the second body to the first: moving the first along it makes the signed
    /// distance grow as much. None only if the solve was stopped before any was found.
    pub normal: Option<Vector3<f64>>,
    /// Derivatives with respect to the twists of the first and of the second body; none without a
    /// normal.
    pub gradients: Option<[Twist; 2]>,
    /// Whether the bracket contains 0: the bodies may just touch. Smooth bodies have the same
    /// derivative on both sides; where edges or corners touch, the derivative in overlap may be
    /// another one.
    pub at_contact: bool,
    /// Whether another direction out of an overlap was seen to be about as short, or the one found
    /// is not known to be the best of those near it, or another pair of parts may be as near: value
    /// and bracket hold, but normal, witnesses and gradients may jump.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl SignedDistance {
    /// The answer inside the bracket that points or a direction attain: the upper bound of bodies
    /// apart, else the lower.
    pub fn value(&self) -> f64 {
        if self.lower > 0.0 { self.upper } else { self.lower }
    }
}

bracketed!(SignedDistance);
