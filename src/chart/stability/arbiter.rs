//! The truth about a distance, from bounds that do not depend on the solver which is judged.
//!
//! Whoever proposes them, two points inside the bodies are at least as far apart as the bodies, and the gap between the bodies'
//! heights along a direction ([`Body::support`]) is at most the distance. The arbiter takes the best of all proposals and of
//! directions all around: an answer that is too long is refuted by somebody's points, one that is too short by somebody's direction.

use super::case::Case;
use crate::body::{Body, fibonacci_lattice};
use crate::measure::Pose;
use nalgebra::Vector3;

/// Directions that are tried whatever is proposed.
const LATTICE: usize = 200;

/// Bounds of a distance, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Truth {
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// What rounding may have done to the bounds.
    pub(super) floor: f64,
}

/// Points of both bodies in the world, metres, and a direction from the second to the first.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Proposal {
    pub(super) points: Option<[Vector3<f64>; 2]>,
    pub(super) normal: Option<Vector3<f64>>,
}

impl Truth {
    /// How far a value is from all that may be true, metres.
    pub(super) fn error(&self, value: f64) -> f64 {
        (self.lower - self.floor - value).max(value - self.upper - self.floor).max(0.0)
    }
}

/// The best bounds for a case; a known value is taken for granted.
pub(super) fn judge(case: &Case, proposals: &[Proposal]) -> Truth {
    let Case { a, pose_a, b, pose_b, .. } = case;
    let sizes = a.circumscribed().radius + b.circumscribed().radius;
    let apart = pose_a.translation() - pose_b.translation();
    let away = pose_a.translation().norm().max(pose_b.translation().norm());
    // Coordinates in the world are rounded in proportion to themselves, heights to the distance of the bodies.
    let floor = 8.0 * f64::EPSILON * (apart.norm() + sizes) + 4.0 * f64::EPSILON * away;
    if let Some(exact) = case.exact {
        return Truth { lower: exact, upper: exact, floor };
    }
    let mut truth = Truth { lower: 0.0, upper: f64::INFINITY, floor };
    let gap = |n: &Vector3<f64>| case.height(n);
    for [x, y] in proposals.iter().filter_map(|proposal| proposal.points) {
        let (x, y) = (drawn_in(a, pose_a, &x), drawn_in(b, pose_b, &y));
        truth.upper = truth.upper.min((pose_a.transform_point(&x) - pose_b.transform_point(&y)).norm());
        if let Some(n) = (pose_a.transform_point(&x) - pose_b.transform_point(&y)).try_normalize(0.0) {
            truth.lower = truth.lower.max(gap(&n));
        }
    }
    let normals = proposals.iter().filter_map(|proposal| proposal.normal?.try_normalize(0.0));
    for n in normals.chain(fibonacci_lattice(LATTICE)) {
        truth.lower = truth.lower.max(gap(&n));
    }
    truth
}

impl Case {
    /// The gap between the bodies' heights along a unit vector from the second to the first, metres: at most their distance.
    pub(super) fn height(&self, n: &Vector3<f64>) -> f64 {
        let Self { a, pose_a, b, pose_b, .. } = self;
        n.dot(&(pose_a.translation() - pose_b.translation())) - reach(a, pose_a, &-n) - reach(b, pose_b, n)
    }
}

/// How far a body reaches along a direction of the world from the origin of its frame, metres.
fn reach(body: &Body, pose: &Pose, n: &Vector3<f64>) -> f64 {
    let n = pose.rotation().inverse_transform_vector(n);
    body.support(&n).height_m + n.dot(body.interior_point())
}

/// The point in the body's frame; one outside moved to the boundary, straight towards the interior point.
fn drawn_in(body: &Body, pose: &Pose, x: &Vector3<f64>) -> Vector3<f64> {
    let x = pose.rotation().inverse_transform_vector(&(x - pose.translation()));
    if body.value(&x) <= 1.0 {
        return x;
    }
    body.boundary_along(&(body.normalization().linear * (x - body.interior_point())))
}
