//! Robots in messages.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::measure::Pose;
use crate::robot::{GroupState, JointKind, Variable};
use crate::scene::{NamedJointValues, PlaceRobot, Robot, RobotId, RobotInstance, RobotLink};
use crate::store::{LoadedRobot, RobotSource};

use super::error::Invalid;
use super::packed::Packed;
use super::{packed, proto, wire};

pub(crate) fn robot_id(id: &str, field: &str) -> Result<RobotId, Invalid> {
    id.parse()
        .map_err(|_| Invalid::new(field, "is no robot id; give the 64 lowercase hexadecimal digits LoadRobot returned"))
}

/// What a robot is to be loaded from.
pub(super) fn source(request: proto::LoadRobotRequest) -> Result<RobotSource, Invalid> {
    let proto::LoadRobotRequest { urdf, srdf, link_bodies, .. } = request;
    if urdf.is_empty() {
        return Err(Invalid::new("urdf", "is empty; send the text of a URDF"));
    }
    let mut bodies = BTreeMap::new();
    for (index, proto::LinkBody { link, body_id }) in link_bodies.into_iter().enumerate() {
        let id = wire::body_id(&body_id, &format!("link_bodies[{index}].body_id"))?;
        if bodies.insert(link.into(), id).is_some() {
            return Err(Invalid::new(format!("link_bodies[{index}].link"), "is named twice; name each link once"));
        }
    }
    Ok(RobotSource { urdf, srdf, bodies })
}

/// A robot without its texts.
pub(super) fn robot(loaded: &LoadedRobot) -> proto::Robot {
    let (robot, kinematics) = (&loaded.robot, loaded.robot.kinematics());
    let names = kinematics.links();
    let link = |(place, (name, link)): (usize, (&Arc<str>, &Option<RobotLink>))| proto::RobotLink {
        name: name.to_string(),
        parent: kinematics.parent(place).map(|parent| names[parent].to_string()).unwrap_or_default(),
        body_id: link.as_ref().map(|link| link.body().to_string()).unwrap_or_default(),
        gap_m: link.as_ref().and_then(|link| link.geometry.gap_m()),
        given: loaded.source.bodies.contains_key(name),
    };
    let description = &loaded.description;
    let group = |group: &crate::robot::Group| proto::RobotGroup {
        name: group.name.to_string(),
        joints: group.joints.iter().map(|&joint| description.joints[joint].name.to_string()).collect(),
        links: group.links.iter().map(|&link| description.links[link].name.to_string()).collect(),
    };
    let state = |state: &GroupState| {
        let own = state.own_values(&description.joints);
        let joints = own.iter().map(|(joint, _)| joint.name.to_string()).collect();
        let values: Vec<f64> = own.iter().flat_map(|(_, values)| *values).copied().collect();
        proto::RobotGroupState {
            name: state.name.to_string(),
            group: loaded.semantics.groups[state.group].name.to_string(),
            joints: Some(proto::JointValues { joints, values: numbers(&values), rows: Vec::new() }),
        }
    };
    proto::Robot {
        summary: Some(summary(robot)),
        links: names.iter().zip(robot.links()).enumerate().map(link).collect(),
        joints: kinematics.variables().iter().map(joint).collect(),
        groups: loaded.semantics.groups.iter().map(group).collect(),
        warnings: loaded.semantics.warnings.iter().map(ToString::to_string).collect(),
        group_states: loaded.semantics.states.iter().map(state).collect(),
    }
}

pub(super) fn summary(robot: &Robot) -> proto::RobotSummary {
    proto::RobotSummary {
        id: robot.id().to_string(),
        name: robot.name().to_string(),
        link_count: wire::count(robot.links().len()),
        width: wire::count(robot.kinematics().width()),
    }
}

fn joint(variable: &Variable) -> proto::RobotJoint {
    let kind = match variable.kind {
        JointKind::Fixed => proto::JointKind::Unspecified,
        JointKind::Revolute => proto::JointKind::Revolute,
        JointKind::Continuous => proto::JointKind::Continuous,
        JointKind::Prismatic => proto::JointKind::Prismatic,
        JointKind::Planar => proto::JointKind::Planar,
        JointKind::Floating => proto::JointKind::Floating,
    };
    proto::RobotJoint {
        name: variable.name.to_string(),
        kind: kind.into(),
        first: wire::count(variable.first),
        width: wire::count(variable.kind.width()),
        lower: variable.limits.map(|limits| limits.lower),
        upper: variable.limits.map(|limits| limits.upper),
    }
}

/// Values of joints, packed or as rows.
pub(crate) fn joint_values(
    values: Option<&proto::JointValues>,
    field: impl Fn(&str) -> String,
) -> Result<NamedJointValues, Invalid> {
    let Some(proto::JointValues { joints, values, rows }) = values else { return Ok(NamedJointValues::default()) };
    let joints = joints.iter().map(|name| name.as_str().into()).collect();
    if !rows.is_empty() {
        if !values.is_empty() {
            return Err(Invalid::new(field(".rows"), "are sent along with values; send either"));
        }
        return Ok(NamedJointValues { joints, values: rows.clone() });
    }
    Ok(NamedJointValues { joints, values: packed::numbers(values, &field(".values"))? })
}

pub(crate) fn joint_values_message(named: &NamedJointValues) -> proto::JointValues {
    let joints = named.joints.iter().map(ToString::to_string).collect();
    proto::JointValues { joints, values: numbers(&named.values), rows: Vec::new() }
}

/// Numbers, packed.
pub(super) fn numbers(values: &[f64]) -> bytes::Bytes {
    let mut packed = Packed::with_capacity(8 * values.len());
    values.iter().for_each(|&value| packed.number(value));
    packed.into_bytes()
}

/// A robot to place, by the id of which `robot` is the robot.
pub(super) fn placement(
    instance: &proto::RobotInstance,
    robot: Arc<Robot>,
    field: impl Fn(&str) -> String,
) -> Result<PlaceRobot, Invalid> {
    Ok(PlaceRobot {
        name: instance.name.as_str().into(),
        robot,
        base: wire::pose(instance.base.as_ref(), &field(".base"))?,
        joints: joint_values(instance.joints.as_ref(), |leaf| field(&format!(".joints{leaf}")))?,
    })
}

/// A robot as it is in a scene.
pub(super) fn instance(instance: &RobotInstance<'_>) -> proto::RobotInstance {
    let values = numbers(instance.configuration());
    let joints = proto::JointValues { joints: Vec::new(), values, rows: Vec::new() };
    instance_message(instance.name(), instance.robot().id(), (instance.base(), joints))
}

pub(crate) fn instance_message(
    name: &str,
    robot: &RobotId,
    (base, joints): (&Pose, proto::JointValues),
) -> proto::RobotInstance {
    proto::RobotInstance {
        name: name.to_owned(),
        robot_id: robot.to_string(),
        base: Some(wire::pose_message(base)),
        joints: Some(joints),
    }
}
