//! Forward kinematics, with a bound of its rounding.
//!
//! Rotations are quaternions. With u the unit roundoff, one joint multiplies by a local quaternion
//! that is off by at most 13 u (sine and cosine within one unit in the last place, one product) and
//! rounds the product by 8 u more, so everything distal turns by at most 42 u too much or too
//! little. The lengths of the quaternions drift by as much, so that what is distal is moved by at
//! most 84 u of the way to it. [`ROUNDING`] covers the sum twice.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::Kinematics;
use super::tree::TreeJoint;
use crate::description::JointKind;

/// Bound of the error that computing one joint adds, per metre of the way from it to a point.
const ROUNDING: f64 = 128.0 * f64::EPSILON;

/// Bound of the error of the pose of a link: no point within r metres of its origin is farther than
/// `at_origin_m + per_metre r` from where exact arithmetic on the same numbers puts it.
#[derive(Clone, Copy, Debug, Default)]
pub struct PlaceError {
    at_origin_m: f64,
    per_metre: f64,
}

impl PlaceError {
    /// Of points within `reach_m` of the origin of the link, metres.
    pub fn within_m(&self, reach_m: f64) -> f64 {
        self.at_origin_m + self.per_metre * reach_m
    }
}

impl Kinematics {
    /// Poses of all links in the order of [`Kinematics::links`], link frame to world frame, metres.
    /// `base` is the pose of the root link, `configuration` packed values of
    /// [`Kinematics::width`] that [`Kinematics::check`] accepts.
    ///
    /// # Panics
    /// When the configuration is too short.
    pub fn forward(&self, base: &Isometry3<f64>, configuration: &[f64], poses: &mut Vec<Isometry3<f64>>) {
        poses.clear();
        poses.push(*base);
        for joint in &self.joints {
            let parent = poses[joint.parent];
            poses.push(joint.child_pose(&parent, configuration));
        }
    }

    /// Bounds of the errors of [`Kinematics::forward`] for the poses that it has given, in the
    /// order of [`Kinematics::links`].
    ///
    /// A joint that turns by δ too much moves a point by δ times the way to it, which is at most as
    /// long as the links between them and the way from the origin of the last one: the sum over
    /// all joints is linear in that, and each link continues those of its parent.
    ///
    /// # Panics
    /// When the poses are not those of this tree.
    pub fn forward_errors(&self, poses: &[Isometry3<f64>], configuration: &[f64], errors: &mut Vec<PlaceError>) {
        errors.clear();
        errors.push(PlaceError::default());
        for (joint, pose) in self.joints.iter().zip(&poses[1..]) {
            let (origin, before) = (&pose.translation.vector, &poses[joint.parent].translation.vector);
            // Translations that cancel are rounded as what they are, not as what is left of them.
            let size = origin.norm() + before.norm() + joint.translation.norm();
            let (mut at_origin_m, mut per_metre) = (ROUNDING * size, ROUNDING);
            if let Some((multiplier, offset)) = joint.mimic {
                let value = f64::EPSILON * ((multiplier * configuration[joint.first]).abs() + offset.abs());
                let is_length = joint.kind == JointKind::Prismatic;
                *(if is_length { &mut at_origin_m } else { &mut per_metre }) += value;
            }
            if matches!(joint.kind, JointKind::Prismatic | JointKind::Planar | JointKind::Floating) {
                let shift = configuration[joint.first..].iter().take(3).map(|value| value.abs()).sum::<f64>();
                at_origin_m += ROUNDING * joint.rate().abs().max(1.0) * shift;
            }
            let parent = errors[joint.parent];
            errors.push(PlaceError {
                at_origin_m: at_origin_m + parent.within_m((origin - before).norm()),
                per_metre: per_metre + parent.per_metre,
            });
        }
    }
}

impl TreeJoint {
    #[inline]
    fn child_pose(&self, parent: &Isometry3<f64>, configuration: &[f64]) -> Isometry3<f64> {
        let at_rest = || *self.rotation.quaternion();
        let (local, shift) = match self.kind {
            JointKind::Fixed => (at_rest(), self.translation),
            JointKind::Revolute | JointKind::Continuous => (self.turned(self.value(configuration)), self.translation),
            JointKind::Prismatic => {
                (at_rest(), self.translation + self.rotation * (self.axis * self.value(configuration)))
            }
            JointKind::Planar => {
                let [x, y, angle] = [0, 1, 2].map(|value| configuration[self.first + value]);
                let shift = self.across[0] * x + self.across[1] * y;
                (self.turned(angle), self.translation + self.rotation * shift)
            }
            JointKind::Floating => {
                let [x, y, z, i, j, k, w] = [0, 1, 2, 3, 4, 5, 6].map(|value| configuration[self.first + value]);
                let turn = Quaternion::new(w, i, j, k);
                (at_rest() * (turn / turn.norm()), self.translation + self.rotation * Vector3::new(x, y, z))
            }
        };
        let rotation = UnitQuaternion::new_unchecked(parent.rotation.into_inner() * local);
        let translation = parent.translation.vector + parent.rotation * shift;
        Isometry3::from_parts(Translation3::from(translation), rotation)
    }

    /// Rotation of the child in the frame of the parent at an angle, radians.
    #[inline]
    fn turned(&self, angle: f64) -> Quaternion<f64> {
        let (sine, cosine) = (0.5 * angle).sin_cos();
        *self.rotation.quaternion() * cosine + self.half_turn * sine
    }
}
