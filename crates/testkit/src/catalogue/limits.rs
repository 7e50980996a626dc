//! Limits and hints: 2, 18.

use super::{Case, Draws, any_two};
use crate::bodies::q;
use crate::random::{pose, shifted};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::PI;
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

/// Iteration limits of family 2.
pub const LIMITS: std::ops::RangeInclusive<u32> = 1..=3;

/// Family 2. Not enough iterations: the bracket contains the truth all the same, and the status
/// says that it is wide.
pub fn few_iterations(limit: u32, zoo: &[Body], random: &mut dyn Draws) -> Case {
    let (a, b, sum) = any_two(random, zoo);
    let reach = sum * random.between(0.2, 4.0);
    let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
    Case { limit: Some(limit), ..Case::new(a, pose_a, b, pose_b, format!("limit {limit}")) }
}

/// Two bodies at their poses whose answer leaves a hint.
pub type Source = (Body, Pose, Body, Pose);

/// Family 18. A case, and queries whose hints it is to be asked with: the same bracketed value.
pub struct Hints {
    pub case: Case,
    pub sources: Vec<Source>,
}

/// Hints of a pose before, another pair, the same pair swapped, the other side of the world,
/// coincident frames, and from beyond floating point.
pub fn bad_hints(zoo: &[Body], random: &mut dyn Draws) -> Hints {
    let (a, b, sum) = any_two(random, zoo);
    let (other_a, other_b, _) = any_two(random, zoo);
    let reach = sum * random.between(0.3, 3.0);
    let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
    let half_turn = UnitQuaternion::from_scaled_axis(random.unit() * PI);
    // Overflow fills a hint with what floating point has to offer.
    let tiny = q(8, 1e-24, 1e-24, 1e-24);
    let nowhere = pose(Vector3::new(1e15, -1e15, 1e15), &UnitQuaternion::identity());
    let origin = Pose::identity();
    let sources = [
        (a, pose_a, b, shifted(&pose_b, random.unit() * 0.01 * sum)),
        (other_a, pose_a, other_b, pose_b),
        (b, pose_b, a, pose_a),
        (a, pose_a, b, pose(-pose_b.translation(), &(half_turn * pose_b.rotation()))),
        (a, pose_a, b, pose_a),
        (&tiny, origin, &tiny, nowhere),
        (&tiny, origin, a, nowhere),
        (a, origin, &tiny, nowhere),
    ];
    let sources = sources.into_iter().map(|(p, pose_p, q, pose_q)| (p.clone(), pose_p, q.clone(), pose_q));
    Hints { case: Case::new(a, pose_a, b, pose_b, "hints"), sources: sources.collect() }
}
