//! What a certificate is about, as plain numbers: the robot, its bodies, obstacles, pairs.

use std::ops::Deref;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use sha2::{Digest, Sha256};

use super::geometry::MotionItem;
use crate::description::JointKind;

/// A pose: translation in metres, quaternion x y z w.
pub(super) type PoseRecord = [f64; 7];

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Claim {
    pub(super) robot: RobotRecord,
    pub(super) base: PoseRecord,
    /// Files of bodies and compounds, each once.
    pub(super) solids: Vec<serde_json::Value>,
    pub(super) bodies: Vec<BodyRecord>,
    pub(super) obstacles: Vec<ObstacleRecord>,
    pub(crate) margin_m: f64,
    /// Pairs that do not count.
    pub(super) allowed: Vec<(MotionItem, MotionItem)>,
    /// Paddings that are not 0, metres.
    pub(super) paddings_m: Vec<(MotionItem, MotionItem, f64)>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotRecord {
    pub(super) name: String,
    pub(super) links: Vec<String>,
    pub(super) joints: Vec<JointRecord>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct JointRecord {
    pub(super) name: String,
    pub(super) kind: JointKind,
    pub(super) parent: usize,
    pub(super) child: usize,
    pub(super) origin: PoseRecord,
    pub(super) axis: [f64; 3],
    pub(super) limits: Option<[f64; 2]>,
    pub(super) mimic: Option<(usize, f64, f64)>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BodyRecord {
    pub(super) name: String,
    pub(super) link: usize,
    pub(super) place: PoseRecord,
    pub(super) shape: ShapeRecord,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum ShapeRecord {
    /// Position in the list of solids.
    Solid(usize),
    /// Radius and half height, metres.
    Capsule(f64, f64),
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ObstacleRecord {
    pub(super) name: String,
    pub(super) placed: PlacedRecord,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum PlacedRecord {
    Still(ShapeRecord, PoseRecord),
    /// The moving frame at the start and at the end.
    Moving(ShapeRecord, PoseRecord, PoseRecord),
    /// The same of what is held there, and its place in the moving frame.
    Carried(ShapeRecord, PoseRecord, PoseRecord, PoseRecord),
    /// Unit normal, offset and bound of its error, metres.
    HalfSpace([f64; 3], f64, f64),
}

/// A claim with the hash of its content, which takes milliseconds to compute.
#[derive(Clone, Debug)]
pub(crate) struct DigestedClaim {
    claim: Claim,
    /// SHA-256 of the JSON text of the claim, hexadecimal.
    digest: String,
}

impl DigestedClaim {
    pub(crate) fn new(claim: Claim) -> Self {
        let text = serde_json::to_vec(&claim).unwrap_or_default();
        Self { claim, digest: hexadecimal(&Sha256::digest(text)) }
    }

    pub(crate) fn digest(&self) -> &str {
        &self.digest
    }

    /// What differs from another claim, if anything does.
    pub(crate) fn difference(&self, other: &Self) -> Option<&'static str> {
        if self.digest == other.digest { None } else { self.claim.difference(&other.claim) }
    }
}

impl Deref for DigestedClaim {
    type Target = Claim;

    fn deref(&self) -> &Claim {
        &self.claim
    }
}

impl Serialize for DigestedClaim {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.claim.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for DigestedClaim {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Claim::deserialize(deserializer).map(Self::new)
    }
}

/// Bytes as hexadecimal digits.
pub(crate) fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Claim {
    /// What differs from another claim, if anything does.
    fn difference(&self, other: &Self) -> Option<&'static str> {
        [
            (self.robot != other.robot, "robot"),
            (self.base != other.base, "base pose"),
            (self.solids != other.solids || self.bodies != other.bodies, "set of bodies"),
            (self.obstacles != other.obstacles, "set of obstacles"),
            (self.margin_m != other.margin_m || self.paddings_m != other.paddings_m, "margin or padding"),
            (self.allowed != other.allowed, "set of allowed pairs"),
        ]
        .into_iter()
        .find_map(|(differs, what)| differs.then_some(what))
    }
}
