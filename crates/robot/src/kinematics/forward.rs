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

    /// Bound of the error of [`Kinematics::forward`] at points of a link, metres: no point within
    /// `reach_m` of the origin of the link is farther than this from where exact arithmetic on the
    /// same numbers puts it.
    ///
    /// # Panics
    /// When the poses are not those of this tree, or the link is none of it.
    pub fn forward_error_m(&self, poses: &[Isometry3<f64>], configuration: &[f64], link: usize, reach_m: f64) -> f64 {
        // Length of the way from the joint to the point.
        let (mut path, mut error, mut at) = (reach_m, 0.0, link);
        while at > 0 {
            let joint = &self.joints[at - 1];
            let origin = &poses[at].translation.vector;
            // Translations that cancel are rounded as what they are, not as what is left of them.
            let before = poses[joint.parent].translation.vector.norm();
            error += ROUNDING * (path + origin.norm() + before + joint.translation.norm());
            if let Some((multiplier, offset)) = joint.mimic {
                let size = (multiplier * configuration[joint.first]).abs() + offset.abs();
                error += f64::EPSILON * size * if joint.kind == JointKind::Prismatic { 1.0 } else { path };
            }
            if matches!(joint.kind, JointKind::Prismatic | JointKind::Planar | JointKind::Floating) {
                let shift = configuration[joint.first..].iter().take(3).map(|value| value.abs()).sum::<f64>();
                error += ROUNDING * joint.rate().abs().max(1.0) * shift;
            }
            path += (origin - poses[joint.parent].translation.vector).norm();
            at = joint.parent;
        }
        error
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
