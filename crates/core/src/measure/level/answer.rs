//! The level distance of two bodies with its proof.

use crate::measure::frames::twist::Twist;
use crate::measure::pairwise_minimum::bracketed;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// Level distance with its proof; unit-free but for the witness.
#[derive(Clone, Copy, Debug)]
pub struct LevelDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound.
    pub lower: f64,
    /// Proven upper bound, attained at the witness.
    pub upper: f64,
    /// A point of the second body where the first one's polynomial is at most `upper`; world frame,
    /// metres.
    pub witness: Vector3<f64>,
    /// How fast d decreases as the level of the second body rises from 1: the sum of the
    /// multipliers of its constraints.
    pub multiplier: f64,
    /// Whether the second body contains the minimiser of the first one's polynomial: d is its
    /// minimum, the multiplier and all derivatives are 0, and d says no more about depth.
    pub saturated: bool,
    /// Derivative of d with respect to the pose of the first body, 1/m and 1/rad: a twist (v, ω)
    /// changes d by `-g·v - ((x - t) × g)·ω`, g the gradient of the first body's polynomial at the
    /// witness x (of several active constraints, weighted by their multipliers) and t the
    /// translation.
    pub gradient_a: Twist,
    /// Derivative of d with respect to the pose of the second body: the same gradient the other
    /// way, about its own translation.
    pub gradient_b: Twist,
    /// Whether another pair of parts may be as low, their brackets meeting: witness, multiplier and
    /// gradients may then jump. Never for single bodies.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl LevelDistance {
    /// The answer inside the bracket: the upper bound, which the witness attains.
    pub fn value(&self) -> f64 {
        self.upper
    }
}

bracketed!(LevelDistance);
