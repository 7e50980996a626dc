//! The states of a request: poses of objects, or joint values of a robot.

use std::sync::Arc;

use tonic::Status;

use super::error::{self, Invalid};
use super::limits::{MAX_STATE_POSES, MAX_STATES};
use super::reason::Reason;
use super::{packed, query_wire};
use crate::robot::Kinematics;
use crate::scene::{Scene, Slot};

/// What places the objects of every state.
#[derive(Debug)]
pub(super) enum PlacedStates {
    /// Objects, and their poses as numbers.
    Poses(Vec<Slot>, Vec<f64>),
    /// Names of joints, and their values.
    Joints(Vec<Arc<str>>, Vec<f64>),
}

impl PlacedStates {
    /// Of `objects` with `poses`, or of a `robot` with `joints` and `joint_values`, within their
    /// limits.
    pub(super) fn of(
        scene: &Scene,
        (objects, poses): (&[String], &[u8]),
        (robot, joints, values): (&str, &[String], &[u8]),
    ) -> Result<Self, Status> {
        if robot.is_empty() {
            if !joints.is_empty() || !values.is_empty() {
                let why = "is missing; name the robot whose joints the states set";
                return Err(Invalid::new("robot", why).into());
            }
            let slots = query_wire::slots(scene, objects, "objects")?;
            let numbers = packed::numbers(poses, "poses")?;
            let poses = numbers.len() / packed::POSE_NUMBERS;
            error::at_most("poses", poses, ("max_state_poses", MAX_STATE_POSES))?;
            error::at_most("poses", poses / slots.len().max(1), ("max_states", MAX_STATES))?;
            return Ok(Self::Poses(slots, numbers));
        }
        if !objects.is_empty() || !poses.is_empty() {
            let why = "is sent along with objects or poses; send either";
            return Err(Invalid::new("robot", why).into());
        }
        let Some(instance) = scene.robot(robot) else {
            let why = format!("no robot \"{robot}\" in scene \"{}\"; place it first", scene.name());
            return Err(error::not_found(Reason::RobotNotFound, robot, "robot", why));
        };
        let numbers = packed::numbers(values, "joint_values")?;
        if let Some(width) = joint_width(instance.robot().kinematics(), joints) {
            error::at_most("joint_values", numbers.len() / width.max(1), ("max_states", MAX_STATES))?;
        }
        Ok(Self::Joints(joints.iter().map(|name| name.as_str().into()).collect(), numbers))
    }
}

/// Values of one configuration: of the joints that are named, a planar one of which has 3 and a
/// floating one 7, or of all without names. None where the robot does not have one of the joints,
/// which is refused with the names.
pub(super) fn joint_width(kinematics: &Kinematics, joints: &[String]) -> Option<usize> {
    if joints.is_empty() {
        return Some(kinematics.width());
    }
    let width = |name: &String| Some(kinematics.variables()[kinematics.variable(name)?].kind.width());
    joints.iter().map(width).sum()
}
