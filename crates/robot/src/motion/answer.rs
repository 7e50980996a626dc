//! What is known of a motion.

use nalgebra::Vector3;

use super::certificate::Certificate;
use super::geometry::MotionItem;

/// What a motion is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionVerdict {
    /// No pair is in contact anywhere on the path: proven.
    Free,
    /// A pair is in contact at a configuration of the path: proven.
    Contact,
    /// Neither is proven.
    Undecided,
}

/// Two items at a place of the path.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionContact {
    /// Path parameter at which it was seen.
    pub s: f64,
    /// The pair.
    pub items: [MotionItem; 2],
    /// Its signed distance there is at least this, metres.
    pub lower_m: f64,
    /// Its signed distance there is at most this, metres; 0 of an overlap whose depth is not known.
    pub upper_m: f64,
    /// A point of each, world frame, metres.
    pub witnesses: [Vector3<f64>; 2],
    /// Unit vector from the second to the first; none of an overlap whose depth is not known.
    pub normal: Option<Vector3<f64>>,
}

/// What is proven of a motion.
#[derive(Clone, Debug)]
pub struct MotionAnswer {
    /// What it is.
    pub verdict: MotionVerdict,
    /// The path is proven free up to this parameter, from the start.
    pub alpha: f64,
    /// All pairs keep at least this signed distance less their padding on the part that is proven
    /// free, metres: at least the margin. Infinite if there are no pairs.
    pub clearance_lower_m: f64,
    /// Of a contact, the first one that was seen in the order of the path; of a motion that is
    /// undecided the first pair that is open. The first contact lies between `alpha` and its `s`.
    pub contact: Option<MotionContact>,
    /// Of a contact, the first pair before it that stays open where no point moves by more than the
    /// resolution: it passes so close to its threshold that `alpha` ends there, maybe well before
    /// the contact. None where the contact is bracketed to the resolution.
    pub open: Option<MotionContact>,
    /// Whether the search ended because of a limit or the stop flag before all was decided.
    pub ended_early: bool,
    /// Configurations that were looked at.
    pub configurations: u32,
    /// Pairs whose distance had to be solved.
    pub solved: u32,
    /// What proves it, if it was asked for and the motion is free.
    pub certificate: Option<Box<Certificate>>,
}
