//! A robot that is to be placed.

use std::sync::Arc;

use sublevel_core::measure::Pose;

use super::{NamedJointValues, Robot};

/// A robot to place in a scene, or to replace whole.
#[derive(Clone, Debug)]
pub struct PlaceRobot {
    /// Unique among the robots of its scene; the group of its links, whose objects are named
    /// `name/LINK`.
    pub name: Arc<str>,
    /// The robot.
    pub robot: Arc<Robot>,
    /// Pose of its root link: link frame to world frame, metres.
    pub base: Pose,
    /// Values of joints; those not named are 0, or the limit nearest to it.
    pub joints: NamedJointValues,
}
