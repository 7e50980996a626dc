//! Rows of robots and of their instances in scenes.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::pose_row::PoseRow;
use super::robot::{LoadedRobot, RobotSource};
use crate::body::BodyId;
use crate::scene::{NamedJointValues, PlaceRobot, Robot, RobotId, RobotInstance, Scene};

/// A robot: what it was loaded from, and the bodies of its links.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotRow {
    urdf: String,
    srdf: String,
    /// Bodies that were given for links.
    given: BTreeMap<String, BodyId>,
    /// Bodies of all links that have one, each once.
    bodies: Vec<BodyId>,
}

impl RobotRow {
    pub(super) fn of(loaded: &LoadedRobot) -> Self {
        let RobotSource { urdf, srdf, bodies } = &loaded.source;
        let mut all: Vec<_> = loaded.bodies().map(|body| *body.id()).collect();
        all.sort_unstable();
        all.dedup();
        Self {
            urdf: urdf.clone(),
            srdf: srdf.clone(),
            given: bodies.iter().map(|(link, id)| (link.to_string(), *id)).collect(),
            bodies: all,
        }
    }

    /// What it was loaded from, and the bodies of its links.
    pub(super) fn into_parts(self) -> (RobotSource, Vec<BodyId>) {
        let Self { urdf, srdf, given, bodies } = self;
        let given = given.into_iter().map(|(link, id)| (link.into(), id)).collect();
        (RobotSource { urdf, srdf, bodies: given }, bodies)
    }
}

/// A robot in a scene.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct InstanceRow {
    robot: RobotId,
    base: PoseRow,
    /// Values of all joints: metres, radians.
    configuration: Vec<f64>,
    /// Paddings of single links, metres.
    link_paddings_m: Vec<(String, f64)>,
}

impl InstanceRow {
    pub(super) fn of(scene: &Scene, instance: &RobotInstance<'_>) -> Self {
        let links = instance.robot().kinematics().links();
        let padding = |(link, slot): (&Arc<str>, &Option<u32>)| {
            let padding = scene.object((*slot)?)?.padding_m?;
            Some((link.to_string(), padding))
        };
        Self {
            robot: *instance.robot().id(),
            base: PoseRow::of(instance.base()),
            configuration: instance.configuration().to_vec(),
            link_paddings_m: links.iter().zip(instance.link_slots()).filter_map(padding).collect(),
        }
    }

    /// Id of the robot.
    pub(super) fn robot(&self) -> &RobotId {
        &self.robot
    }

    /// The robot as it is to be placed.
    pub(super) fn placement(&self, name: &str, robot: Arc<Robot>) -> Result<PlaceRobot, String> {
        let base = self.base.pose().map_err(|error| format!("robot \"{name}\" has no base: {error}"))?;
        let joints = NamedJointValues { joints: Vec::new(), values: self.configuration.clone() };
        Ok(PlaceRobot { name: name.into(), robot, base, joints })
    }

    /// Paddings by the names of objects, metres.
    pub(super) fn paddings(&self, name: &str) -> impl Iterator<Item = (Arc<str>, Option<f64>)> {
        self.link_paddings_m.iter().map(move |(link, padding)| (format!("{name}/{link}").into(), Some(*padding)))
    }
}
