//! Tables of the catalogue and the content of their rows. JSON: a few hundred bytes each, readable
//! with any redb viewer, and numbers survive the round trip exactly.

use redb::TableDefinition;
use serde::{Deserialize, Serialize};

use super::pose_row::PoseRow;
use crate::body::BodyId;
use crate::measure::Pose;
use crate::scene::{Attachment, Geometry, Ladder, Object, Placement, Scene, Subject, SubjectPair, Update};

/// Raised whenever older programs could not read the tables any more, or this one not theirs. 4:
/// jobs of several kinds. 5: robots, and their instances in scenes.
pub(super) const FORMAT: u64 = 5;

/// The format before robots: what it has is the same in the present one.
pub(super) const FORMAT_4: u64 = 4;

/// `format`, and `revision_floor`: no new scene starts at or below it.
pub(super) const META: TableDefinition<&str, u64> = TableDefinition::new("meta");
/// Body id to body file.
pub(super) const BODIES: TableDefinition<&str, &[u8]> = TableDefinition::new("bodies");
/// Ladder id to [`LadderRow`].
pub(super) const LADDERS: TableDefinition<&str, &[u8]> = TableDefinition::new("ladders");
/// Robot id to [`RobotRow`](super::robot_row::RobotRow).
pub(super) const ROBOTS: TableDefinition<&str, &[u8]> = TableDefinition::new("robots");
/// Scene name and name of a robot in it to [`InstanceRow`](super::robot_row::InstanceRow): new
/// joint values rewrite one row. The objects of its links have no rows.
pub(super) const INSTANCES: TableDefinition<(&str, &str), &[u8]> = TableDefinition::new("instances");
/// Scene name to [`SceneRow`].
pub(super) const SCENES: TableDefinition<&str, &[u8]> = TableDefinition::new("scenes");
/// Scene name to a revision up to which revisions may have been given out without being written: a
/// scene that has one starts above it.
pub(super) const RESERVES: TableDefinition<&str, u64> = TableDefinition::new("reserves");
/// Scene name to revision: apart from the scene's row, so that a new pose does not rewrite the
/// allowed pairs.
pub(super) const REVISIONS: TableDefinition<&str, u64> = TableDefinition::new("revisions");
/// Scene and object name to [`ObjectRow`]: a new pose rewrites one row, whatever the size of the
/// scene.
pub(super) const OBJECTS: TableDefinition<(&str, &str), &[u8]> = TableDefinition::new("objects");
/// Job id to [`Job`](super::Job). This table and the next two are missing from files that never
/// had a job.
pub(super) const JOBS: TableDefinition<u64, &[u8]> = TableDefinition::new("jobs");
/// Job id to the coordinates of its points, metres, as little-endian f64; of fits that have not
/// ended.
pub(super) const POINTS: TableDefinition<u64, &[u8]> = TableDefinition::new("points");
/// Job id to the corners of the triangles between its points, as little-endian u32; of fits that
/// have not ended.
pub(super) const TRIANGLES: TableDefinition<u64, &[u8]> = TableDefinition::new("triangles");

/// A ladder: its rungs are bodies of their own.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LadderRow {
    name: String,
    /// Coarsest first.
    rungs: Vec<BodyId>,
}

impl LadderRow {
    pub(super) fn of(ladder: &Ladder) -> Self {
        Self { name: ladder.name().to_owned(), rungs: ladder.rungs().iter().map(|rung| *rung.id()).collect() }
    }

    /// Ids of its rungs, coarsest first.
    pub(super) fn rungs(&self) -> &[BodyId] {
        &self.rungs
    }

    /// The ladder, from bodies by their ids.
    pub(super) fn ladder(&self, body: impl Fn(&BodyId) -> Option<Geometry>) -> Result<Ladder, String> {
        let rung = |id: &BodyId| match body(id) {
            Some(Geometry::Solid(shape)) => Ok(shape),
            _ => Err(format!("its rung {id} cannot be used")),
        };
        let rungs = self.rungs.iter().map(rung).collect::<Result<_, _>>()?;
        Ladder::new(&self.name, rungs).map_err(|error| error.to_string())
    }
}

/// What a scene says besides its objects.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneRow {
    allowed: Vec<[SubjectRow; 2]>,
    group_paddings_m: Vec<(String, f64)>,
    pair_paddings_m: Vec<([SubjectRow; 2], f64)>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SubjectRow {
    Object(String),
    Group(String),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectRow {
    pub(super) body: String,
    /// In the world, or in what holds the object.
    pose: PoseRow,
    group: String,
    padding_m: Option<f64>,
    attachment: Option<AttachmentRow>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct AttachmentRow {
    to: String,
    touch: Vec<SubjectRow>,
}

impl SceneRow {
    pub(super) fn of(scene: &Scene) -> Self {
        let pair = |(a, b): &SubjectPair| [SubjectRow::of(a), SubjectRow::of(b)];
        let rules = scene.rules();
        Self {
            allowed: rules.allowed().map(pair).collect(),
            group_paddings_m: rules.group_paddings().map(|(group, padding)| (group.to_string(), padding)).collect(),
            pair_paddings_m: rules.pair_paddings().map(|(sides, padding)| (pair(sides), padding)).collect(),
        }
    }

    /// The update that sets all that in a scene with its objects.
    pub(super) fn update(&self) -> Update {
        let pair = |[a, b]: &[SubjectRow; 2]| (a.subject(), b.subject());
        let group = |(group, padding): &(String, f64)| (group.as_str().into(), Some(*padding));
        Update {
            allow: self.allowed.iter().map(pair).collect(),
            group_paddings: self.group_paddings_m.iter().map(group).collect(),
            pair_paddings: self.pair_paddings_m.iter().map(|(sides, padding)| (pair(sides), Some(*padding))).collect(),
            ..Update::default()
        }
    }
}

impl SubjectRow {
    fn of(subject: &Subject) -> Self {
        match subject {
            Subject::Object(name) => Self::Object(name.to_string()),
            Subject::Group(name) => Self::Group(name.to_string()),
        }
    }

    fn subject(&self) -> Subject {
        match self {
            Self::Object(name) => Subject::Object(name.as_str().into()),
            Self::Group(name) => Subject::Group(name.as_str().into()),
        }
    }
}

impl ObjectRow {
    /// An object at a world pose.
    pub(super) fn of(object: &Object, pose: &Pose) -> Self {
        let attachment = object.attachment.as_ref();
        Self {
            body: object.geometry.id().to_string(),
            pose: PoseRow::of(attachment.map_or(pose, |attachment| &attachment.pose)),
            group: object.group.to_string(),
            padding_m: object.padding_m,
            attachment: attachment.map(|Attachment { to, touch, .. }| AttachmentRow {
                to: to.to_string(),
                touch: touch.iter().map(SubjectRow::of).collect(),
            }),
        }
    }

    /// The object as it is to be placed.
    pub(super) fn placement(&self, name: &str) -> Result<Placement, String> {
        let pose = self.pose.pose().map_err(|error| format!("has no pose: {error}"))?;
        let attachment = self.attachment.as_ref().map(|row| Attachment {
            to: row.to.as_str().into(),
            pose,
            touch: row.touch.iter().map(SubjectRow::subject).collect(),
        });
        Ok(Placement {
            name: name.into(),
            body: self.body.parse().map_err(|error| format!("is made of no body: {error}"))?,
            pose: attachment.is_none().then_some(pose),
            group: self.group.as_str().into(),
            padding_m: self.padding_m,
            attachment,
        })
    }
}

/// A row as it is written.
pub(super) fn json(row: &impl Serialize) -> Result<Vec<u8>, redb::Error> {
    serde_json::to_vec(row).map_err(|error| redb::Error::Io(error.into()))
}
