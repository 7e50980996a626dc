//! A robot where it stands in a scene.

use std::sync::Arc;

use sublevel_core::measure::Pose;

use super::Robot;
use crate::object::Slot;

/// What of an instance belongs to the structure of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Instance {
    pub(crate) robot: Arc<Robot>,
    /// By link: the slot of its object; none of frames.
    pub(crate) slots: Vec<Option<Slot>>,
}

/// What of an instance changes as often as poses.
#[derive(Clone, Debug)]
pub(crate) struct Stance {
    /// Root link to world.
    pub(crate) base: Pose,
    /// Packed values of all joints that follow no other one.
    pub(crate) configuration: Vec<f64>,
    /// Revision at which either was last set.
    pub(crate) stamp: u64,
}

/// A robot in a scene: which one, where it stands, and the values of its joints.
#[derive(Clone, Copy, Debug)]
pub struct RobotInstance<'a> {
    pub(crate) name: &'a Arc<str>,
    pub(crate) instance: &'a Instance,
    pub(crate) stance: &'a Stance,
}

impl<'a> RobotInstance<'a> {
    /// Unique among the robots of its scene, and the group of its links.
    pub fn name(&self) -> &'a Arc<str> {
        self.name
    }

    /// The robot.
    pub fn robot(&self) -> &'a Arc<Robot> {
        &self.instance.robot
    }

    /// Pose of its root link: link frame to world frame, metres.
    pub fn base(&self) -> &'a Pose {
        &self.stance.base
    }

    /// Values of all joints that follow no other one, in the order of
    /// [`Kinematics::variables`](sublevel_robot::Kinematics::variables): radians, metres, unit
    /// quaternions.
    pub fn configuration(&self) -> &'a [f64] {
        &self.stance.configuration
    }

    /// Slots of the objects of its links, in the order of
    /// [`Kinematics::links`](sublevel_robot::Kinematics::links); none of links without geometry.
    pub fn link_slots(&self) -> &'a [Option<Slot>] {
        &self.instance.slots
    }

    /// Revision at which its base or its joints were last set.
    pub fn moved_at(&self) -> u64 {
        self.stance.stamp
    }
}
