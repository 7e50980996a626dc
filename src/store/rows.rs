//! Tables of the catalogue and what their rows hold. JSON: a few hundred bytes each, readable with
//! any redb viewer, and numbers survive the round trip exactly.

use redb::TableDefinition;
use serde::{Deserialize, Serialize};

use crate::measure::{Pose, PoseError};
use crate::scene::{Object, Scene};

/// Raised whenever older programs could not read the tables any more, or this one not theirs. 2:
/// fit jobs hold a request with a mode.
pub(super) const FORMAT: u64 = 2;

/// `format`, and `revision_floor`: no new scene starts at or below it.
pub(super) const META: TableDefinition<&str, u64> = TableDefinition::new("meta");
/// Body id to body file.
pub(super) const BODIES: TableDefinition<&str, &[u8]> = TableDefinition::new("bodies");
/// Scene name to [`SceneRow`].
pub(super) const SCENES: TableDefinition<&str, &[u8]> = TableDefinition::new("scenes");
/// Scene name to revision: apart from the scene's row, so that a new pose does not rewrite the
/// allowed pairs.
pub(super) const REVISIONS: TableDefinition<&str, u64> = TableDefinition::new("revisions");
/// Scene and object name to [`ObjectRow`]: a new pose rewrites one row, whatever the size of the
/// scene.
pub(super) const OBJECTS: TableDefinition<(&str, &str), &[u8]> = TableDefinition::new("objects");
/// Job id to [`Job`](super::Job). This table and the next three are missing from files that never
/// had a job.
pub(super) const JOBS: TableDefinition<u64, &[u8]> = TableDefinition::new("jobs");
/// Job id to the coordinates of its points, metres, as little-endian f64; of jobs that have not
/// ended.
pub(super) const POINTS: TableDefinition<u64, &[u8]> = TableDefinition::new("points");
/// Job id to the corners of the triangles between its points, as little-endian u32; of jobs that
/// have not ended.
pub(super) const TRIANGLES: TableDefinition<u64, &[u8]> = TableDefinition::new("triangles");
/// Job id to the file of the compound or sos-body that it made.
pub(super) const FILES: TableDefinition<u64, &[u8]> = TableDefinition::new("files");

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneRow {
    pub(super) allowed: Vec<(String, String)>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObjectRow {
    pub(super) body: String,
    translation_m: [f64; 3],
    /// x, y, z, w.
    rotation: [f64; 4],
    pub(super) group: String,
}

impl SceneRow {
    pub(super) fn of(scene: &Scene) -> Self {
        let allowed = scene.allowed_pairs().map(|(a, b)| (a.to_string(), b.to_string())).collect();
        Self { allowed }
    }
}

impl ObjectRow {
    pub(super) fn of(object: &Object) -> Self {
        Self {
            body: object.body.id().to_string(),
            translation_m: (*object.pose.translation()).into(),
            rotation: object.pose.rotation().coords.into(),
            group: object.group.to_string(),
        }
    }

    /// The pose with the very bits that were stored: a pose is normalised when it comes in, and
    /// once only.
    pub(super) fn pose(&self) -> Result<Pose, PoseError> {
        Pose::from_quaternion(self.translation_m.into(), self.rotation)
    }
}
