//! Scenes in messages.

use std::sync::Arc;

use tonic::Status;

use crate::measure::Pose;
use crate::robot::counted;
use crate::scene::{
    Attach, Attachment, NamedJointValues, Object, PlaceRobot, Placement, Robot, RobotId, Scene, Subject, SubjectPair,
    Update,
};
use crate::store::{Origin, SceneEntry};

use super::error::{self, Invalid};
use super::limits::MAX_MESSAGE_BYTES;
use super::packed::Packed;
use super::proto::{self, subject};
use super::reason::Reason;
use super::{packed, robot_wire, wire};

/// An update as it is asked for, without the robots that it places, which [`placed_robots`] adds.
pub(super) fn update(request: &proto::UpdateSceneRequest) -> Result<Update, Invalid> {
    let mut update = Update { expected_revision: request.expected_revision, ..Update::default() };
    for (index, object) in request.upsert_objects.iter().enumerate() {
        if !object.robot.is_empty() {
            let why = "is sent only, of links of robots; set the joints of the robot instead of the object";
            return Err(Invalid::new(format!("upsert_objects[{index}].robot"), why));
        }
        update.upserts.push(placement(object, || format!("upsert_objects[{index}]"))?);
    }
    if let Some(table) = &request.set_poses {
        update.poses = pose_table(table, "set_poses")?;
    }
    update.removals = names(&request.remove_objects);
    update.detach = names(&request.detach);
    update.allow = subject_pairs(&request.allow_pairs, "allow_pairs")?;
    update.forbid = subject_pairs(&request.forbid_pairs, "forbid_pairs")?;
    let objects = request.set_object_paddings.iter();
    update.object_paddings = objects.map(|padding| (padding.object.as_str().into(), padding.padding_m)).collect();
    let groups = request.set_group_paddings.iter();
    update.group_paddings = groups.map(|padding| (padding.group.as_str().into(), padding.padding_m)).collect();
    for (index, padding) in request.set_pair_paddings.iter().enumerate() {
        let at = || format!("set_pair_paddings[{index}].pair");
        let pair = padding.pair.as_ref().ok_or_else(|| missing(at()))?;
        update.pair_paddings.push((subject_pair(pair, at)?, padding.padding_m));
    }
    for (index, attach) in request.attach.iter().enumerate() {
        let at = |leaf: &str| format!("attach[{index}].attachment{leaf}");
        let attachment = attach.attachment.as_ref().ok_or_else(|| missing(at("")))?;
        update.attach.push(Attach {
            name: attach.object.as_str().into(),
            to: attachment.to.as_str().into(),
            pose: attachment.pose.as_ref().map(|pose| wire::pose(Some(pose), &at(".pose"))).transpose()?,
            touch: subjects(&attachment.touch, || at(".touch"))?,
        });
    }
    for (index, set) in request.set_joints.iter().enumerate() {
        let field = |leaf: &str| format!("set_joints[{index}].joints{leaf}");
        update.joints.push((set.robot.as_str().into(), robot_wire::joint_values(set.joints.as_ref(), field)?));
    }
    for (index, set) in request.set_robot_bases.iter().enumerate() {
        let base = wire::pose(set.base.as_ref(), &format!("set_robot_bases[{index}].base"))?;
        update.bases.push((set.robot.as_str().into(), base));
    }
    update.robot_removals = names(&request.remove_robots);
    Ok(update)
}

/// Ids of the robots that a request places, in its order.
pub(super) fn placed_robot_ids(request: &proto::UpdateSceneRequest) -> Result<Vec<RobotId>, Invalid> {
    let id = |(index, placed): (usize, &proto::RobotInstance)| {
        robot_wire::robot_id(&placed.robot_id, &format!("place_robots[{index}].robot_id"))
    };
    request.place_robots.iter().enumerate().map(id).collect()
}

/// The robots that a request places, of [`placed_robot_ids`].
pub(super) fn placed_robots(
    request: &proto::UpdateSceneRequest,
    robots: Vec<Arc<Robot>>,
) -> Result<Vec<PlaceRobot>, Invalid> {
    let one = |(index, (placed, robot)): (usize, (&proto::RobotInstance, Arc<Robot>))| {
        robot_wire::placement(placed, robot, |leaf| format!("place_robots[{index}]{leaf}"))
    };
    request.place_robots.iter().zip(robots).enumerate().map(one).collect()
}

/// The placement that a message asks for; `field` is the path of the object in the request.
pub(crate) fn placement(object: &proto::Object, field: impl Fn() -> String) -> Result<Placement, Invalid> {
    let at = |leaf: &str| format!("{}.{leaf}", field());
    let attachment = match &object.attachment {
        None => None,
        Some(attachment) => Some(Attachment {
            to: attachment.to.as_str().into(),
            pose: wire::pose(attachment.pose.as_ref(), &at("attachment.pose"))?,
            touch: subjects(&attachment.touch, || at("attachment.touch"))?,
        }),
    };
    let pose = match (&object.pose, &attachment) {
        (None, Some(_)) => None,
        (pose, _) => Some(wire::pose(pose.as_ref(), &at("pose"))?),
    };
    Ok(Placement {
        name: object.name.as_str().into(),
        body: wire::body_id(&object.body_id, &at("body_id"))?,
        pose,
        group: object.group.as_str().into(),
        padding_m: object.padding_m,
        attachment,
    })
}

/// The message that asks for an update.
pub(crate) fn update_message(scene: &str, update: &Update) -> proto::UpdateSceneRequest {
    let owned = |names: &[Arc<str>]| names.iter().map(ToString::to_string).collect();
    let object = |(object, padding_m): &(Arc<str>, Option<f64>)| proto::ObjectPadding {
        object: object.to_string(),
        padding_m: *padding_m,
    };
    let group = |(group, padding_m): &(Arc<str>, Option<f64>)| proto::GroupPadding {
        group: group.to_string(),
        padding_m: *padding_m,
    };
    let pair = |(pair, padding_m): &(SubjectPair, Option<f64>)| proto::PairPadding {
        pair: Some(pair_message(pair)),
        padding_m: *padding_m,
    };
    let attach = |Attach { name, to, pose, touch }: &Attach| proto::Attach {
        object: name.to_string(),
        attachment: Some(attachment_message(to, pose.as_ref(), touch)),
    };
    let poses = update.poses.iter().map(|(name, pose)| (&**name, *pose));
    let robot = |placed: &PlaceRobot| {
        let joints = robot_wire::joint_values_message(&placed.joints);
        robot_wire::instance_message(&placed.name, placed.robot.id(), (&placed.base, joints))
    };
    let joints = |(robot, values): &(Arc<str>, NamedJointValues)| proto::SetJoints {
        robot: robot.to_string(),
        joints: Some(robot_wire::joint_values_message(values)),
    };
    let base = |(robot, base): &(Arc<str>, Pose)| proto::SetRobotBase {
        robot: robot.to_string(),
        base: Some(wire::pose_message(base)),
    };
    proto::UpdateSceneRequest {
        scene: scene.to_owned(),
        expected_revision: update.expected_revision,
        upsert_objects: update.upserts.iter().map(placement_message).collect(),
        set_poses: (!update.poses.is_empty()).then(|| pose_table_message(poses)),
        remove_objects: owned(&update.removals),
        allow_pairs: update.allow.iter().map(pair_message).collect(),
        forbid_pairs: update.forbid.iter().map(pair_message).collect(),
        set_object_paddings: update.object_paddings.iter().map(object).collect(),
        set_group_paddings: update.group_paddings.iter().map(group).collect(),
        set_pair_paddings: update.pair_paddings.iter().map(pair).collect(),
        attach: update.attach.iter().map(attach).collect(),
        detach: owned(&update.detach),
        place_robots: update.robots.iter().map(robot).collect(),
        set_joints: update.joints.iter().map(joints).collect(),
        set_robot_bases: update.bases.iter().map(base).collect(),
        remove_robots: owned(&update.robot_removals),
    }
}

fn placement_message(placement: &Placement) -> proto::Object {
    let Placement { name, body, pose, group, padding_m, attachment } = placement;
    let held = |Attachment { to, pose, touch }: &Attachment| attachment_message(to, Some(pose), touch);
    proto::Object {
        name: name.to_string(),
        body_id: body.to_string(),
        pose: pose.as_ref().map(wire::pose_message),
        group: group.to_string(),
        padding_m: *padding_m,
        attachment: attachment.as_ref().map(held),
        robot: String::new(),
    }
}

fn attachment_message(to: &str, pose: Option<&Pose>, touch: &[Subject]) -> proto::Attachment {
    let (pose, touch) = (pose.map(wire::pose_message), touch.iter().map(subject_message).collect());
    proto::Attachment { to: to.to_owned(), pose, touch }
}

/// Poses by object name, packed.
pub(crate) fn pose_table_message<'a>(poses: impl IntoIterator<Item = (&'a str, Pose)>) -> proto::PoseTable {
    let (mut names, mut packed) = (Vec::new(), Packed::default());
    for (name, pose) in poses {
        names.push(name.to_owned());
        packed.pose(&pose);
    }
    proto::PoseTable { names, poses: packed.into_bytes(), rows: Vec::new() }
}

/// Poses by object name, packed or as rows.
pub(super) fn pose_table(table: &proto::PoseTable, field: &str) -> Result<Vec<(Arc<str>, Pose)>, Invalid> {
    let proto::PoseTable { names, poses, rows } = table;
    if !rows.is_empty() {
        if !names.is_empty() || !poses.is_empty() {
            return Err(Invalid::new(format!("{field}.rows"), "are sent along with names and poses; send either"));
        }
        let row = |(index, row): (usize, &proto::ObjectPose)| {
            let pose = wire::pose(row.pose.as_ref(), &format!("{field}.rows[{index}].pose"))?;
            Ok((row.name.as_str().into(), pose))
        };
        return rows.iter().enumerate().map(row).collect();
    }
    let poses = packed::poses(poses, &format!("{field}.poses"))?;
    if names.len() != poses.len() {
        let (poses, names) = (counted(poses.len(), "pose", "poses"), counted(names.len(), "name", "names"));
        let why = format!("holds {poses} for {names}; send one for each");
        return Err(Invalid::new(format!("{field}.poses"), why));
    }
    Ok(names.iter().map(|name| name.as_str().into()).zip(poses).collect())
}

fn names(names: &[String]) -> Vec<Arc<str>> {
    names.iter().map(|name| name.as_str().into()).collect()
}

fn missing(field: String) -> Invalid {
    Invalid::new(field, "is missing; send it")
}

fn subject(subject: &proto::Subject, field: impl Fn() -> String) -> Result<Subject, Invalid> {
    match &subject.subject {
        Some(subject::Subject::Object(name)) => Ok(Subject::Object(name.as_str().into())),
        Some(subject::Subject::Group(name)) => Ok(Subject::Group(name.as_str().into())),
        None => Err(Invalid::new(field(), "names neither an object nor a group; name one")),
    }
}

fn subjects(subjects: &[proto::Subject], field: impl Fn() -> String) -> Result<Vec<Subject>, Invalid> {
    let one = |(index, one): (usize, &proto::Subject)| subject(one, || format!("{}[{index}]", field()));
    subjects.iter().enumerate().map(one).collect()
}

fn subject_pair(pair: &proto::SubjectPair, field: impl Fn() -> String) -> Result<SubjectPair, Invalid> {
    let side = |side: &Option<proto::Subject>, leaf: &str| {
        let at = || format!("{}.{leaf}", field());
        subject(side.as_ref().ok_or_else(|| missing(at()))?, at)
    };
    Ok((side(&pair.a, "a")?, side(&pair.b, "b")?))
}

pub(crate) fn subject_pairs(pairs: &[proto::SubjectPair], field: &str) -> Result<Vec<SubjectPair>, Invalid> {
    let one = |(index, pair): (usize, &proto::SubjectPair)| subject_pair(pair, || format!("{field}[{index}]"));
    pairs.iter().enumerate().map(one).collect()
}

pub(super) fn summary(entry: &SceneEntry) -> proto::SceneSummary {
    let SceneEntry { name, revision, objects, origin } = entry;
    proto::SceneSummary {
        name: name.to_string(),
        revision: *revision,
        object_count: wire::count(*objects),
        parent: origin.as_ref().map(|origin| origin.parent.to_string()).unwrap_or_default(),
        parent_revision: origin.as_ref().map_or(0, |origin| origin.revision),
    }
}

/// Name of the last object of the page before; a page of another revision is refused.
pub(super) fn page_token(token: &str, scene: &Scene) -> Result<Option<String>, Status> {
    if token.is_empty() {
        return Ok(None);
    }
    let malformed = || Invalid::new("page_token", "is no token of GetScene; begin with an empty one");
    let (revision, name) = token.split_once(' ').ok_or_else(malformed)?;
    let revision: u64 = revision.parse().map_err(|_| malformed())?;
    if revision != scene.structure_revision() {
        let why = "objects came or went since the page before; begin again with an empty page_token";
        return Err(error::aborted(Reason::SceneChanged, "page_token", why, scene.revision()));
    }
    Ok(Some(name.to_owned()))
}

/// A page of a scene: as many objects as were asked for and fit in a message.
pub(super) fn page(
    scene: &Scene,
    origin: Option<&Origin>,
    after: Option<&str>,
    size: usize,
) -> proto::GetSceneResponse {
    let entry = SceneEntry::of(scene, origin);
    let mut response = proto::GetSceneResponse { scene: Some(summary(&entry)), ..Default::default() };
    if after.is_none() {
        let rules = scene.rules();
        response.allowed_pairs = rules.allowed().map(pair_message).collect();
        let groups = rules.group_paddings();
        let group = |(group, padding): (&Arc<str>, f64)| proto::GroupPadding {
            group: group.to_string(),
            padding_m: Some(padding),
        };
        response.group_paddings = groups.map(group).collect();
        let pair = |(pair, padding): (&SubjectPair, f64)| proto::PairPadding {
            pair: Some(pair_message(pair)),
            padding_m: Some(padding),
        };
        response.pair_paddings = rules.pair_paddings().map(pair).collect();
        response.robots = scene.robots().map(|robot| robot_wire::instance(&robot)).collect();
    }
    let mut bytes = prost::Message::encoded_len(&response);
    let rest: Box<dyn Iterator<Item = _>> = match after {
        None => Box::new(scene.objects()),
        Some(name) => Box::new(scene.objects_after(name)),
    };
    for (_, object, pose) in rest {
        let message = object_message(object, pose);
        bytes += prost::Message::encoded_len(&message) + 16;
        let full = bytes > MAX_MESSAGE_BYTES - 1024 && !response.objects.is_empty();
        if response.objects.len() == size || full {
            let last = response.objects.last().map(|last| last.name.as_str()).unwrap_or_default();
            response.next_page_token = format!("{} {last}", scene.structure_revision());
            break;
        }
        response.objects.push(message);
    }
    response
}

pub(super) fn object_message(object: &Object, pose: &Pose) -> proto::Object {
    let held = |Attachment { to, pose, touch }: &Attachment| attachment_message(to, Some(pose), touch);
    proto::Object {
        name: object.name.to_string(),
        body_id: object.geometry.id().to_string(),
        pose: Some(wire::pose_message(pose)),
        group: object.group.to_string(),
        padding_m: object.padding_m,
        attachment: object.attachment.as_ref().map(held),
        robot: object.link.as_ref().map(|of| of.robot.to_string()).unwrap_or_default(),
    }
}

fn subject_message(subject: &Subject) -> proto::Subject {
    let subject = match subject {
        Subject::Object(name) => subject::Subject::Object(name.to_string()),
        Subject::Group(name) => subject::Subject::Group(name.to_string()),
    };
    proto::Subject { subject: Some(subject) }
}

fn pair_message((a, b): &SubjectPair) -> proto::SubjectPair {
    proto::SubjectPair { a: Some(subject_message(a)), b: Some(subject_message(b)) }
}
