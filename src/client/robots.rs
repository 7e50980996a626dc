//! Robots, and their places in scenes.

use std::sync::Arc;

use super::connection::{Client, Connection};
use super::error::ClientError;
use crate::body::BodyId;
use crate::measure::Pose;
use crate::robot::{JointKind, Limits, Variable};
use crate::scene::{NamedJointValues, RobotId, Update};
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto::robot_service_client::RobotServiceClient;
use crate::service::proto::{self, DeleteRobotRequest, GetRobotRequest, LinkBody, ListRobotsRequest, LoadRobotRequest};
use crate::service::{robot_wire, scene_wire, wire};
use crate::store::RobotSource;

/// A robot that a server has.
#[derive(Clone, Debug)]
pub struct StoredRobot {
    /// Its id.
    pub id: RobotId,
    /// Name that its URDF gives it.
    pub name: String,
    /// Links, parents before children.
    pub links: Vec<StoredLink>,
    /// Joints with values of their own, in the order of joint vectors.
    pub joints: Vec<Variable>,
    /// Groups of the SRDF, with the names of joints and links.
    pub groups: Vec<StoredGroup>,
    /// Named states of the groups, in the order of the SRDF.
    pub group_states: Vec<StoredGroupState>,
    /// What is odd in the SRDF.
    pub warnings: Vec<String>,
    /// Whether the call made it; false when the server had it before.
    pub created: bool,
}

/// A link of a robot that a server has.
#[derive(Clone, Debug)]
pub struct StoredLink {
    /// Its name.
    pub name: String,
    /// Name of the link that it hangs on; none of the root.
    pub parent: Option<String>,
    /// Its body in the frame of the link; none of frames.
    pub body: Option<BodyId>,
    /// How far the body reaches beyond the convex hull of its object at most, metres, where known.
    pub gap_m: Option<f64>,
}

/// A group of the SRDF of a robot that a server has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredGroup {
    /// Its name.
    pub name: String,
    /// Names of its joints.
    pub joints: Vec<String>,
    /// Names of its links.
    pub links: Vec<String>,
}

/// Values of joints of a group under a name: a `group_state` of the SRDF.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredGroupState {
    /// Its name, unique in its group.
    pub name: String,
    /// Name of the group.
    pub group: String,
    /// The joints with values of their own that it sets, in the order of joint vectors, and their
    /// values: radians, metres, unit quaternions. Without names it sets none of these.
    pub joints: NamedJointValues,
}

impl StoredGroupState {
    /// Names of the joints that it sets, as questions take them: the values go with them.
    pub fn joint_names(&self) -> impl Iterator<Item = &str> {
        self.joints.joints.iter().map(|name| &**name)
    }
}

/// A robot in a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ListedRobot {
    /// Its id.
    pub id: RobotId,
    /// Name that its URDF gives it; not unique.
    pub name: String,
    /// Number of its links.
    pub links: u32,
    /// Number of values of all joints: the length of its joint vectors.
    pub width: u32,
}

/// A robot to place in a scene.
#[derive(Clone, Debug)]
pub struct RobotPlacement {
    /// Unique among the robots of the scene; the group of its links.
    pub name: Arc<str>,
    /// The robot.
    pub robot: RobotId,
    /// Pose of its root link: link frame to world frame, metres.
    pub base: Pose,
    /// Values of joints, radians or metres; those not named are 0, or the limit nearest to it.
    pub joints: NamedJointValues,
}

impl RobotPlacement {
    /// A robot with its root link at the origin of the world, and its joints at 0 or at the limit
    /// nearest to it.
    pub fn new(name: &str, robot: &StoredRobot) -> Self {
        Self { name: name.into(), robot: robot.id, base: Pose::identity(), joints: NamedJointValues::default() }
    }

    /// With its root link elsewhere: link frame to world frame, metres.
    #[must_use]
    pub fn with_base(self, base: Pose) -> Self {
        Self { base, ..self }
    }

    /// With values of joints, radians or metres; those not named are 0, or the limit nearest to it.
    #[must_use]
    pub fn with_joints(self, joints: NamedJointValues) -> Self {
        Self { joints, ..self }
    }

    /// The robot of a message that is at a field of another.
    pub(super) fn of(instance: &proto::RobotInstance, field: &str) -> Result<Self, ClientError> {
        Ok(Self {
            name: instance.name.as_str().into(),
            robot: robot_wire::robot_id(&instance.robot_id, &format!("{field}.robot_id"))?,
            base: wire::pose(instance.base.as_ref(), &format!("{field}.base"))?,
            joints: robot_wire::joint_values(instance.joints.as_ref(), |leaf| format!("{field}.joints{leaf}"))?,
        })
    }
}

impl StoredRobot {
    fn of(robot: Option<proto::Robot>, created: bool) -> Result<Self, ClientError> {
        let unreadable = || ClientError::Unexpected("a robot that cannot be read");
        let proto::Robot { summary, links, joints, groups, warnings, group_states } = robot.ok_or_else(unreadable)?;
        let summary = summary.ok_or_else(unreadable)?;
        let link = |link: proto::RobotLink| {
            let body = if link.body_id.is_empty() { None } else { Some(link.body_id.parse().ok()?) };
            let parent = Some(link.parent).filter(|parent| !parent.is_empty());
            Some(StoredLink { name: link.name, parent, body, gap_m: link.gap_m })
        };
        Ok(Self {
            id: summary.id.parse().map_err(|_| unreadable())?,
            name: summary.name,
            links: links.into_iter().map(link).collect::<Option<_>>().ok_or_else(unreadable)?,
            joints: joints.iter().map(variable).collect::<Option<_>>().ok_or_else(unreadable)?,
            groups: groups.into_iter().map(group).collect(),
            group_states: group_states.into_iter().enumerate().map(group_state).collect::<Result<_, _>>()?,
            warnings,
            created,
        })
    }
}

fn group(proto::RobotGroup { name, joints, links }: proto::RobotGroup) -> StoredGroup {
    StoredGroup { name, joints, links }
}

fn group_state((index, state): (usize, proto::RobotGroupState)) -> Result<StoredGroupState, ClientError> {
    let proto::RobotGroupState { name, group, joints } = state;
    let field = |leaf: &str| format!("robot.group_states[{index}].joints{leaf}");
    Ok(StoredGroupState { name, group, joints: robot_wire::joint_values(joints.as_ref(), field)? })
}

fn variable(joint: &proto::RobotJoint) -> Option<Variable> {
    let kind = match proto::JointKind::try_from(joint.kind).ok()? {
        proto::JointKind::Unspecified => return None,
        proto::JointKind::Revolute => JointKind::Revolute,
        proto::JointKind::Continuous => JointKind::Continuous,
        proto::JointKind::Prismatic => JointKind::Prismatic,
        proto::JointKind::Planar => JointKind::Planar,
        proto::JointKind::Floating => JointKind::Floating,
    };
    let limits = joint.lower.zip(joint.upper).map(|(lower, upper)| Limits { lower, upper });
    Some(Variable { name: joint.name.as_str().into(), kind, first: usize::try_from(joint.first).ok()?, limits })
}

impl Client {
    fn robots(&self) -> RobotServiceClient<Connection> {
        RobotServiceClient::new(self.channel()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// Loads a robot from the texts of a URDF and an SRDF, with bodies for its links.
    ///
    /// # Errors
    /// When a text cannot be read, a link has a mesh and no body, or a body is not there.
    pub async fn load_robot(&self, source: &RobotSource) -> Result<StoredRobot, ClientError> {
        let RobotSource { urdf, srdf, bodies } = source.clone();
        let body = |(link, id): (Arc<str>, BodyId)| LinkBody { link: link.to_string(), body_id: id.to_string() };
        let link_bodies = bodies.into_iter().map(body).collect();
        self.load_robot_with(LoadRobotRequest { urdf, srdf, link_bodies, ..LoadRobotRequest::default() }).await
    }

    /// The same with everything that the protocol knows, such as the meshes of links, around which
    /// the server fits bodies.
    ///
    /// # Errors
    /// As [`Client::load_robot`], and when a mesh cannot be fitted.
    pub async fn load_robot_with(&self, request: LoadRobotRequest) -> Result<StoredRobot, ClientError> {
        let response = self.robots().load_robot(request).await.map_err(self.refused())?.into_inner();
        StoredRobot::of(response.robot, response.created)
    }

    /// One robot by its id.
    ///
    /// # Errors
    /// When there is none.
    pub async fn robot(&self, id: &RobotId) -> Result<StoredRobot, ClientError> {
        let request = GetRobotRequest { id: id.to_string() };
        let response = self.robots().get_robot(request).await.map_err(self.refused())?.into_inner();
        StoredRobot::of(response.robot, false)
    }

    /// All robots, in the order of their ids.
    ///
    /// # Errors
    /// When the server does not answer.
    pub async fn list_robots(&self) -> Result<Vec<ListedRobot>, ClientError> {
        let (mut client, mut robots, mut page_token) = (self.robots(), Vec::new(), String::new());
        loop {
            let request = ListRobotsRequest { page_size: 1000, page_token };
            let page = client.list_robots(request).await.map_err(self.refused())?.into_inner();
            for (index, robot) in page.robots.into_iter().enumerate() {
                let id = robot_wire::robot_id(&robot.id, &format!("robots[{index}].id"))?;
                robots.push(ListedRobot { id, name: robot.name, links: robot.link_count, width: robot.width });
            }
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(robots);
            }
        }
    }

    /// Removes a robot that no scene has.
    ///
    /// # Errors
    /// When there is none, or a scene has it.
    pub async fn delete_robot(&self, id: &RobotId) -> Result<(), ClientError> {
        self.robots().delete_robot(DeleteRobotRequest { id: id.to_string() }).await.map_err(self.refused())?;
        Ok(())
    }

    /// Places a robot in a scene, or replaces the one of its name; returns the revision.
    ///
    /// # Errors
    /// When there is no such scene or robot, or a joint value cannot be taken.
    pub async fn place_robot(&self, scene: &str, placement: &RobotPlacement) -> Result<u64, ClientError> {
        let RobotPlacement { name, robot, base, joints } = placement;
        let joints = robot_wire::joint_values_message(joints);
        let mut request = scene_wire::update_message(scene, &Update::default());
        request.place_robots.push(robot_wire::instance_message(name, robot, (base, joints)));
        let response = self.scenes().update_scene(request).await.map_err(self.refused())?;
        Ok(response.into_inner().revision)
    }

    /// Sets joints of a robot in a scene; returns the revision.
    ///
    /// # Errors
    /// When there is no such scene or robot, or a joint value cannot be taken.
    pub async fn set_joints(&self, scene: &str, robot: &str, joints: NamedJointValues) -> Result<u64, ClientError> {
        let update = Update { joints: vec![(robot.into(), joints)], ..Update::default() };
        let request = scene_wire::update_message(scene, &update);
        let response = self.scenes().update_scene(request).await.map_err(self.refused())?;
        Ok(response.into_inner().revision)
    }
}
