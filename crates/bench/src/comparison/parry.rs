//! GJK of parry on convex hulls, in this process.

use super::sweep::Answer;
use crate::machine::locked;
use nalgebra::Vector3;
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::query::details::{
    closest_points_support_map_support_map_with_params, contact_support_map_support_map,
    distance_support_map_support_map,
};
use parry3d_f64::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d_f64::query::{NonlinearRigidMotion, cast_shapes_nonlinear};
use parry3d_f64::shape::{Ball, ConvexPolyhedron, Cuboid};
use sublevel::measure::Pose;
use sublevel_testkit::catalogue::motion::Flight;

/// Two convex hulls as parry's shapes.
#[derive(Clone, Debug)]
pub struct Hulls {
    a: ConvexPolyhedron,
    b: ConvexPolyhedron,
}

/// Parry made no hull of the points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("parry finds no convex hull of the points; remove near-duplicate points")]
pub struct NoHull;

/// The pose in parry's types.
pub fn parry_pose(pose: &Pose) -> ParryPose {
    let (t, q) = (pose.translation(), pose.rotation());
    ParryPose::from_parts(Vector::new(t.x, t.y, t.z), Rotation::from_xyzw(q.i, q.j, q.k, q.w))
}

/// The version that is built in.
pub fn parry_version() -> String {
    locked("parry3d-f64")
}

fn parry_motion(flight: &Flight) -> NonlinearRigidMotion {
    let vector = |v: &Vector3<f64>| Vector::new(v.x, v.y, v.z);
    NonlinearRigidMotion::new(parry_pose(&flight.start), Vector::ZERO, vector(&flight.velocity), vector(&flight.spin))
}

/// When a box of these half-extents and a ball, metres, meet within `duration` seconds; none if
/// they are not found to.
pub fn parry_impact((half, a): (&Vector3<f64>, &Flight), (radius, b): (f64, &Flight), duration: f64) -> Option<f64> {
    let (cuboid, ball) = (Cuboid::new(Vector::new(half.x, half.y, half.z)), Ball::new(radius));
    let found = cast_shapes_nonlinear(&parry_motion(a), &cuboid, &parry_motion(b), &ball, 0.0, duration, true);
    found.ok()?.map(|hit| hit.time_of_impact)
}

impl Hulls {
    /// The hulls of these points, metres.
    ///
    /// # Errors
    /// [`NoHull`].
    pub fn new(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> Result<Self, NoHull> {
        let shape = |points: &[Vector3<f64>]| {
            let points: Vec<Vector> = points.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
            ConvexPolyhedron::from_convex_hull(&points).ok_or(NoHull)
        };
        Ok(Self { a: shape(a)?, b: shape(b)? })
    }

    /// Distance, metres.
    pub fn distance(&self, pose: &ParryPose) -> f64 {
        distance_support_map_support_map(pose, &self.a, &self.b)
    }

    /// Signed distance, metres: minus the depth in overlap, by GJK and EPA. None if they find none.
    pub fn signed_distance(&self, pose: &ParryPose) -> Option<f64> {
        contact_support_map_support_map(pose, &self.a, &self.b, f64::MAX).map(|contact| contact.dist)
    }

    /// One query; the hulls are known to be apart: 0 is a failure.
    pub fn cold(&self, pose: &ParryPose) -> Answer {
        let distance = self.distance(pose);
        Answer { iterations: None, failed: distance <= 0.0, overlap: distance <= 0.0 }
    }

    /// The same in parry's warm form, from the direction between the closest points before.
    pub fn warm(&self, pose: &ParryPose, direction: &mut Option<Vector>) -> Answer {
        let mut simplex = VoronoiSimplex::new();
        let found = closest_points_support_map_support_map_with_params(
            pose,
            &self.a,
            &self.b,
            f64::MAX,
            &mut simplex,
            *direction,
        );
        let apart = match found {
            // From a to b, which is the direction of the support point to begin with.
            GJKResult::ClosestPoints(x, y, _) => {
                *direction = Some(y - x);
                true
            }
            _ => {
                *direction = None;
                false
            }
        };
        Answer { iterations: None, failed: !apart, overlap: !apart }
    }
}
