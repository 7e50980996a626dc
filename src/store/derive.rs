//! What is asked of the pairs of links of a robot, and what was proven, as both are kept: JSON.

use serde::{Deserialize, Serialize};

use crate::robot::motion::PairClass;
use crate::scene::RobotId;

/// Which pairs of links of a robot can touch at all.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeriveRequest {
    /// The robot.
    pub robot: RobotId,
    /// A pair is in contact when its signed distance is below this, metres.
    pub margin_m: f64,
    /// Most boxes of joint values that are looked at for one pair.
    pub max_boxes: u32,
    /// Boxes in which no point moves by more than this, metres, are not divided.
    pub resolution_m: f64,
}

/// What was proven of all pairs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeriveOutcome {
    /// Every pair of links with geometry.
    pub pairs: Vec<DerivedLinkPair>,
    /// Wall time.
    pub seconds: f64,
}

/// What was proven of two links.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DerivedLinkPair {
    /// Names of the links, in the order of the robot's links.
    pub links: [String; 2],
    /// Whether they can touch.
    pub class: PairClass,
    /// Joint values of the deepest contact that was seen; of adjacent and undecided pairs of the
    /// least distance. None of pairs that never touch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub witness: Option<Vec<f64>>,
    /// The least signed distance that was seen, at most, metres.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upper_m: Option<f64>,
    /// Whether the convex hulls of the links, or of their parts, are in contact at the witness, not
    /// only the bodies.
    pub is_certain: bool,
    /// Boxes of joint values that were looked at.
    pub boxes: u32,
    /// Reason of the SRDF for not checking the pair, may be empty; none: it is checked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub srdf_reason: Option<String>,
}

impl DerivedLinkPair {
    /// Whether the SRDF says that the pair is not checked, and it can be in contact at the witness;
    /// of pairs that always are, if it says that they never are.
    pub fn contradicts_srdf(&self) -> bool {
        match (&self.srdf_reason, self.class) {
            (Some(_), PairClass::Collides) => true,
            (Some(reason), PairClass::Always) => reason == "Never",
            _ => false,
        }
    }

    /// Whether the pair is proven never to touch, or always to do so.
    pub fn is_proven(&self) -> bool {
        matches!(self.class, PairClass::Never | PairClass::Always)
    }
}
