//! What ours are compared with: hulls, hulls made simpler, boxes, balls and meshes of other
//! libraries.

use super::outer::outer;
use crate::comparison::ComparisonError;
use crate::comparison::Subject;
use crate::comparison::{Hulls, parry_pose, sweep::Answer};
use nalgebra::{UnitQuaternion, Vector3};
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::query::details::{distance_ball_ball, distance_cuboid_cuboid};
use parry3d_f64::shape::{Ball, Cuboid};
use sublevel::fit::{EnclosingBall, OrientedBox, smallest_ball, smallest_box};
use sublevel::measure::Pose;

/// Vertices of the simplified hulls.
const COUNTS: [usize; 5] = [16, 32, 64, 128, 256];

/// The hulls of a pair, exact or with fewer vertices.
pub(super) struct HullPair {
    /// How many vertices they were allowed; none for the exact ones.
    pub(super) count: Option<usize>,
    /// Their vertices, metres.
    pub(super) vertices: [Vec<Vector3<f64>>; 2],
    /// As parry's shapes.
    pub(super) parry: Hulls,
}

/// The exact hulls, and simpler ones of as many vertices as are allowed at each of [`COUNTS`], the
/// exact one where an object has no more.
pub(super) fn hulls(a: &Subject, b: &Subject, quick: bool) -> Result<Vec<HullPair>, ComparisonError> {
    let counts = if quick { &COUNTS[1..3] } else { &COUNTS[..] };
    let simple = [a, b].map(|subject| outer(&subject.hull, counts));
    let pair = |count, vertices: [Vec<Vector3<f64>>; 2]| {
        let parry = Hulls::new(&vertices[0], &vertices[1])?;
        Ok::<_, ComparisonError>(HullPair { count, vertices, parry })
    };
    let mut all = vec![pair(None, [a.hull.clone(), b.hull.clone()])?];
    for (k, &count) in counts.iter().enumerate() {
        let found = [&simple[0][k], &simple[1][k]];
        if found.iter().any(|found| found.is_some()) {
            let vertices =
                [(found[0], &a.hull), (found[1], &b.hull)].map(|(found, hull)| found.as_ref().unwrap_or(hull));
            all.push(pair(Some(count), vertices.map(Clone::clone))?);
        }
    }
    Ok(all)
}

/// The smallest balls and boxes of a pair as parry's shapes, with the poses of the second in the
/// frame of the first.
pub(super) struct Simple {
    balls: [Ball; 2],
    boxes: [Cuboid; 2],
    pub(super) ball_poses: Vec<Vec<ParryPose>>,
    pub(super) box_poses: Vec<Vec<ParryPose>>,
}

impl Simple {
    pub(super) fn new(a: &Subject, b: &Subject, poses: &[Vec<Pose>]) -> Self {
        let [ball_a, ball_b] = [a, b].map(|subject| smallest_ball(&subject.hull));
        let [box_a, box_b] = [a, b].map(|subject| smallest_box(&subject.hull));
        let between = |of_a: ParryPose, of_b: ParryPose| {
            let relative = |pose: &Pose| of_a.inv_mul(&(parry_pose(pose) * of_b));
            poses.iter().map(|trajectory| trajectory.iter().map(relative).collect()).collect()
        };
        let at = |ball: &EnclosingBall| ParryPose::from_parts(vector(&ball.center), Rotation::IDENTITY);
        let along = |found: &OrientedBox| {
            let turn = UnitQuaternion::from_matrix(&found.axes);
            ParryPose::from_parts(vector(&found.center), Rotation::from_xyzw(turn.i, turn.j, turn.k, turn.w))
        };
        Self {
            ball_poses: between(at(&ball_a), at(&ball_b)),
            box_poses: between(along(&box_a), along(&box_b)),
            balls: [ball_a, ball_b].map(|ball| Ball::new(ball.radius)),
            boxes: [box_a, box_b].map(|found| Cuboid::new(vector(&found.half_extents))),
        }
    }

    pub(super) fn ball(&self, pose: &ParryPose) -> Answer {
        judged(distance_ball_ball(&self.balls[0], pose.translation, &self.balls[1]))
    }

    pub(super) fn cuboid(&self, pose: &ParryPose) -> Answer {
        judged(distance_cuboid_cuboid(pose, &self.boxes[0], &self.boxes[1]))
    }
}

/// Overlap is an answer; only of hulls it is known that there is none.
pub(super) fn judged(distance: f64) -> Answer {
    Answer { iterations: None, failed: distance.is_nan(), overlap: distance <= 0.0 }
}

fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}
