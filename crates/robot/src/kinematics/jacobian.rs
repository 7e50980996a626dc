//! How a point of a link moves when joint values change.

use nalgebra::{Isometry3, Quaternion, Vector3};

use super::Kinematics;
use super::tree::TreeJoint;
use crate::description::JointKind;

/// Linear velocity of a point, and angular velocity, per unit of one value; world frame.
type Column = (Vector3<f64>, Vector3<f64>);

impl Kinematics {
    /// Geometric Jacobian of a link at a point of the world frame: for every value of a
    /// configuration the linear velocity of the point (metres per unit of the value) and the
    /// angular velocity (radians per unit), world frame. Values of joints that others mimic count
    /// these, too; of a floating joint the four numbers of the quaternion are taken as they are
    /// normalised. `poses` are those of [`Kinematics::forward`].
    ///
    /// # Panics
    /// When the poses or the configuration are not of this tree, or the link is none of it.
    pub fn jacobian(
        &self,
        poses: &[Isometry3<f64>],
        configuration: &[f64],
        link: usize,
        point: &Vector3<f64>,
    ) -> Vec<Column> {
        let mut columns = vec![(Vector3::zeros(), Vector3::zeros()); self.width()];
        self.visit_columns(poses, configuration, link, point, |value, linear, angular| {
            columns[value].0 += linear;
            columns[value].1 += angular;
        });
        columns
    }

    /// Adds to a row, one number a value of a configuration, the derivative of a quantity that
    /// changes by `linear·v + angular·ω` when the link moves with velocity v at `point` and angular
    /// velocity ω; world frame.
    ///
    /// # Panics
    /// As [`Kinematics::jacobian`], and when the row is too short.
    pub fn add_gradient(
        &self,
        poses: &[Isometry3<f64>],
        configuration: &[f64],
        (link, point): (usize, &Vector3<f64>),
        (linear, angular): (&Vector3<f64>, &Vector3<f64>),
        row: &mut [f64],
    ) {
        self.visit_columns(poses, configuration, link, point, |value, v, w| {
            row[value] += linear.dot(&v) + angular.dot(&w);
        });
    }

    /// Visits the joints from a link to the root: place of the value, linear and angular velocity.
    fn visit_columns(
        &self,
        poses: &[Isometry3<f64>],
        configuration: &[f64],
        link: usize,
        point: &Vector3<f64>,
        mut visit: impl FnMut(usize, Vector3<f64>, Vector3<f64>),
    ) {
        let mut at = link;
        while at > 0 {
            let joint = &self.joints[at - 1];
            joint.visit_columns(&poses[joint.parent], &poses[at], configuration, point, &mut visit);
            at = joint.parent;
        }
    }
}

impl TreeJoint {
    fn visit_columns(
        &self,
        parent: &Isometry3<f64>,
        child: &Isometry3<f64>,
        configuration: &[f64],
        point: &Vector3<f64>,
        visit: &mut impl FnMut(usize, Vector3<f64>, Vector3<f64>),
    ) {
        let lever = point - child.translation.vector;
        let (first, rate) = (self.first, self.rate());
        // Frame of the joint at rest to the world.
        let rest = parent.rotation * self.rotation;
        match self.kind {
            JointKind::Fixed => {}
            JointKind::Revolute | JointKind::Continuous => {
                let axis = rest * self.axis * rate;
                visit(first, axis.cross(&lever), axis);
            }
            JointKind::Prismatic => visit(first, rest * self.axis * rate, Vector3::zeros()),
            JointKind::Planar => {
                visit(first, rest * self.across[0], Vector3::zeros());
                visit(first + 1, rest * self.across[1], Vector3::zeros());
                let axis = rest * self.axis;
                visit(first + 2, axis.cross(&lever), axis);
            }
            JointKind::Floating => {
                for (value, axis) in [Vector3::x(), Vector3::y(), Vector3::z()].iter().enumerate() {
                    visit(first + value, rest * axis, Vector3::zeros());
                }
                let [i, j, k, w] = [3, 4, 5, 6].map(|value| configuration[first + value]);
                let turn = Quaternion::new(w, i, j, k);
                let inverse = turn.conjugate() / turn.norm_squared();
                let units = [
                    Quaternion::new(0.0, 1.0, 0.0, 0.0),
                    Quaternion::new(0.0, 0.0, 1.0, 0.0),
                    Quaternion::new(0.0, 0.0, 0.0, 1.0),
                    Quaternion::new(1.0, 0.0, 0.0, 0.0),
                ];
                // q' = e gives R' R^T = [ω]x with ω = 2 Im(e q^-1), in the frame of the joint.
                for (value, unit) in units.iter().enumerate() {
                    let turning = rest * ((unit * inverse).imag() * 2.0);
                    visit(first + 3 + value, turning.cross(&lever), turning);
                }
            }
        }
    }
}
