//! A pose as rows store it.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::measure::{Pose, PoseError};

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PoseRow {
    translation_m: [f64; 3],
    /// x, y, z, w.
    rotation: [f64; 4],
}

impl PoseRow {
    pub(super) fn of(pose: &Pose) -> Self {
        Self { translation_m: (*pose.translation()).into(), rotation: pose.rotation().coords.into() }
    }

    /// The pose with the very bits that were stored: a pose is normalised when it comes in, and
    /// once only.
    pub(super) fn pose(&self) -> Result<Pose, PoseError> {
        Pose::from_quaternion(self.translation_m.into(), self.rotation)
    }
}

/// For fields that are poses, with `#[serde(with)]`.
pub(super) fn serialize<S: Serializer>(pose: &Pose, serializer: S) -> Result<S::Ok, S::Error> {
    PoseRow::of(pose).serialize(serializer)
}

/// See [`serialize`].
pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Pose, D::Error> {
    PoseRow::deserialize(deserializer)?.pose().map_err(serde::de::Error::custom)
}
