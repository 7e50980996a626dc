//! Shapes of parry's own, each asked about another.

use super::parry::{NoHull, parry_pose};
use super::peer_shape::PeerShape;
use nalgebra::Vector3;
use parry3d_f64::math::{Pose as ParryPose, Vector};
use parry3d_f64::query::{contact, distance};
use parry3d_f64::shape::{HalfSpace, SharedShape};
use sublevel::measure::Pose;

/// A shape of parry's where it stands.
pub(crate) struct ParryShape {
    shape: SharedShape,
    pose: ParryPose,
}

impl ParryShape {
    /// A shape at a pose of ours.
    ///
    /// # Errors
    /// [`NoHull`].
    pub(crate) fn new(shape: &PeerShape<'_>, pose: &Pose) -> Result<Self, NoHull> {
        let (shape, frame) = shape.parry()?;
        Ok(Self { shape, pose: parry_pose(pose) * frame })
    }

    /// The points of the pose's frame with z at most 0.
    pub(crate) fn half_space(pose: &Pose) -> Self {
        Self { shape: SharedShape::new(HalfSpace::new(Vector::new(0.0, 0.0, 1.0))), pose: parry_pose(pose) }
    }

    /// Distance from another shape, metres, 0 in overlap; none of pairs that parry cannot be asked
    /// about.
    pub(crate) fn distance(&self, other: &Self) -> Option<f64> {
        distance(&self.pose, &*self.shape, &other.pose, &*other.shape).ok().map(|found| found.distance)
    }

    /// Distance from a point of the world, metres, 0 inside.
    pub(crate) fn distance_to_point(&self, point: &Vector3<f64>) -> f64 {
        self.shape.distance_to_point(&self.pose, Vector::new(point.x, point.y, point.z), true)
    }

    /// Signed distance from another shape, metres: minus the depth in overlap. None of pairs that
    /// parry cannot be asked about, or finds nothing for.
    pub(crate) fn signed_distance(&self, other: &Self) -> Option<f64> {
        let found = contact(&self.pose, &*self.shape, &other.pose, &*other.shape, f64::MAX);
        found.ok()?.map(|contact| contact.dist)
    }
}
