//! The distance of two bodies with its proof.

use crate::body::{Body, Solid};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::pairwise_minimum::bracketed;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// Distance of two bodies with its proof, lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct Distance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; 0 when the bodies are not proven apart.
    pub lower: f64,
    /// Proven upper bound, attained by the witnesses; 0 on overlap.
    pub upper: f64,
    /// A point of the first body.
    pub witness_a: Vector3<f64>,
    /// A point of the second body; on overlap the same common point.
    pub witness_b: Vector3<f64>,
    /// Unit normal from the second body to the first; none on overlap.
    pub normal: Option<Vector3<f64>>,
    /// Constraints of the first body, or of its part, that the answer rests on, with multipliers:
    /// `-n = Σ λ_i ∇g_i`; none on overlap.
    pub active_a: ActiveConstraints,
    /// Constraints of the second body, or of its part, that the answer rests on: `n = Σ λ_i ∇g_i`;
    /// none on overlap.
    pub active_b: ActiveConstraints,
    /// Which part of each solid the answer is about: positions in [`Solid::parts`], 0 for single
    /// bodies.
    pub parts: [u16; 2],
    /// Whether another pair of parts may be as near, their brackets meeting: normal, witnesses and
    /// gradients may then jump. Never for single bodies, nor on overlap.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl Default for Distance {
    /// What is known of any two bodies: a place for an answer.
    fn default() -> Self {
        Self {
            status: Status::BracketWide,
            lower: 0.0,
            upper: f64::INFINITY,
            witness_a: Vector3::zeros(),
            witness_b: Vector3::zeros(),
            normal: None,
            active_a: ActiveConstraints::default(),
            active_b: ActiveConstraints::default(),
            parts: [0, 0],
            tied: false,
            iterations: 0,
        }
    }
}

impl Distance {
    /// The answer: the middle of the bracket.
    pub fn value(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// Upper bound of the distance of the convex hulls of the objects that the bodies `a` and `b`
    /// of this answer were fitted to, metres: the bodies contain them, so that `lower` is a bound
    /// of their distance as well, and reach at most their gaps ([`Body::gap_m`]) beyond. None where
    /// a gap is not known. Of solids with several parts, each the hull of its own piece.
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use sublevel_core::body::Body;
    /// use sublevel_core::measure::{Options, Pose, WarmStart, distance};
    ///
    /// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?.with_gap(0.25);
    /// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
    /// let origin = Pose::identity();
    /// let answer = distance(&ball, &origin, &ball, &apart, &Options::default(), &mut WarmStart::default());
    /// assert!((answer.hulls_upper(&ball, &ball).expect("both gaps are known") - 1.5).abs() < 1e-8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn hulls_upper(&self, a: &impl Solid, b: &impl Solid) -> Option<f64> {
        let gap = |solid: &[Body], part: u16| solid.get(usize::from(part))?.gap_m();
        let gaps = (gap(a.parts(), self.parts[0])? + gap(b.parts(), self.parts[1])?).next_up();
        Some((self.upper + gaps).next_up())
    }

    /// Derivatives with respect to the twists of the first and of the second body at the poses the
    /// distance was asked for (envelope theorem: the witnesses count as fixed to their bodies), to
    /// 1e-6 of their norm at distances above the accuracy that was asked for. None unless the
    /// bodies are proven apart: at contact the distance has no gradient, which is what
    /// [`crate::measure::signed_distance`] is for.
    pub fn gradients(&self, pose_a: &Pose, pose_b: &Pose) -> Option<[Twist; 2]> {
        let n = self.normal.filter(|_| self.lower > 0.0)?;
        Some([
            Twist::of_gradient(n, &self.witness_a, pose_a.translation()),
            Twist::of_gradient(-n, &self.witness_b, pose_b.translation()),
        ])
    }
}

bracketed!(Distance);
