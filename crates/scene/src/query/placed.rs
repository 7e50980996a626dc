//! Many states of the same objects: who stands where in each, and which pairs may be near.

use std::collections::HashMap;
use std::sync::Arc;

use sublevel_core::measure::Pose;

use super::around::Around;
use super::invalid_state::InvalidState;
use super::moving::Moving;
use super::packed::{JointStates, POSE_NUMBERS, Packed, State};
use super::states_error::StatesError;
use super::thing::Thing;
use crate::broad_phase::{Tree, grown, world_box};
use crate::object::Slot;
use crate::pair_cache::PairCache;
use crate::scene::Scene;

/// Objects that stand still up to which all are looked at, without the tree.
const FEW: usize = 64;

thread_local! {
    static STARTS: PairCache = PairCache::with_entries(4096);
}

/// Lends the warm starts of this thread, which serve from state to state. They are shared by all
/// scenes: what another pair left is a wrong hint only.
pub(crate) fn with_starts<T>(work: impl FnOnce(&PairCache) -> T) -> T {
    STARTS.with(work)
}

/// States of a robot as packed values of its joints.
#[derive(Clone, Debug)]
pub struct JointValues<'a> {
    /// Name of the robot in the scene.
    pub robot: &'a str,
    /// Joints whose values are given, in that order; empty for all that follow no other one.
    pub joints: &'a [Arc<str>],
    /// Their values, state after state, in radians or metres.
    pub values: Vec<f64>,
}

/// Objects that every state places, and all others.
#[derive(Debug)]
pub(crate) struct Placed {
    scene: Scene,
    /// Placed objects as they are named, then what they hold, each after its holder.
    moving: Vec<Moving>,
    packed: Packed,
    still: Still,
    include_allowed: bool,
}

/// What stands still.
#[derive(Debug)]
enum Still {
    /// Few: all of them, with what contains them.
    Few(Vec<(Slot, Option<Around>)>),
    /// Many: the tree, and which of its leaves move.
    Many(Arc<Tree>, HashMap<Slot, usize>),
}

impl Placed {
    /// States of objects as packed poses.
    pub(crate) fn new(
        scene: Scene,
        slots: &[Slot],
        poses: Vec<f64>,
        include_allowed: bool,
    ) -> Result<Self, StatesError> {
        if slots.is_empty() {
            return Err(StatesError::NoObject);
        }
        if poses.is_empty() {
            return Err(StatesError::NoState);
        }
        let per_state = slots.len() * POSE_NUMBERS;
        if !poses.len().is_multiple_of(per_state) {
            return Err(StatesError::Numbers { numbers: poses.len(), per_state, objects: slots.len() });
        }
        let packed = Packed::Poses { objects: slots.len(), numbers: poses };
        Self::with(scene, slots, packed, include_allowed)
    }

    /// States of a robot as packed joint values.
    pub(crate) fn of_joints(scene: Scene, asked: JointValues<'_>, include_allowed: bool) -> Result<Self, StatesError> {
        let JointValues { robot, joints, values } = asked;
        let instance = scene.robot(robot).ok_or_else(|| StatesError::NoRobot(robot.into()))?;
        let slots: Vec<Slot> = instance.link_slots().iter().flatten().copied().collect();
        if slots.is_empty() {
            return Err(StatesError::NoGeometry(robot.into()));
        }
        let packed = Packed::Joints(JointStates::new(&instance, joints, values)?);
        Self::with(scene, &slots, packed, include_allowed)
    }

    fn with(scene: Scene, slots: &[Slot], packed: Packed, include_allowed: bool) -> Result<Self, StatesError> {
        let (mut moving, mut places) = (Vec::<Moving>::new(), HashMap::new());
        for (index, &slot) in slots.iter().enumerate() {
            if places.insert(slot, index).is_some() {
                return Err(StatesError::Twice(index));
            }
            if let Some(object) = scene.object(slot) {
                moving.push(Moving::named(slot, object));
            }
        }
        for slot in scene.held_by(slots) {
            if places.contains_key(&slot) {
                continue;
            }
            let Some(object) = scene.object(slot) else { continue };
            let Some(attachment) = &object.attachment else { continue };
            let Some(&holder) = scene.slot(&attachment.to).and_then(|holder| places.get(&holder)) else { continue };
            places.insert(slot, moving.len());
            moving.push(Moving::held(slot, object, (&moving[holder], holder), attachment.pose));
        }
        let standing = scene.len() - moving.len();
        let still = if standing <= FEW {
            let others = scene.objects().filter(|(slot, _, _)| !places.contains_key(slot));
            Still::Few(others.map(|(slot, object, pose)| (slot, Around::new(&Thing::object(object, pose)))).collect())
        } else {
            Still::Many(scene.tree().clone(), places)
        };
        Ok(Self { scene, moving, packed, still, include_allowed })
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of states.
    pub(crate) fn states(&self) -> usize {
        self.packed.len()
    }

    /// Places all moving objects in a state.
    ///
    /// # Errors
    /// A number that is no pose or no joint value.
    pub(crate) fn place(&self, index: usize, state: &mut State) -> Result<(), InvalidState> {
        self.packed.place(index, &self.moving, state)
    }

    /// The states where they are joint values.
    pub(crate) fn joints(&self) -> Option<&JointStates> {
        self.packed.joints()
    }

    /// The moving object in a slot, with its position.
    pub(crate) fn find(&self, slot: Slot) -> Option<(usize, &Moving)> {
        self.moving.iter().enumerate().find(|(_, moving)| moving.slot == slot)
    }

    /// The thing that a moving object is in a state.
    pub(crate) fn moving<'a>(&'a self, index: usize, state: &'a State) -> (Slot, Thing<'a>) {
        self.moving_at(index, &state.poses[index])
    }

    /// The thing that a moving object is at one pose.
    pub(crate) fn moving_at<'a>(&'a self, index: usize, pose: &'a Pose) -> (Slot, Thing<'a>) {
        let moving = &self.moving[index];
        (moving.slot, Thing::object(&moving.object, pose))
    }

    /// The thing that stands in a slot.
    pub(crate) fn standing(&self, slot: Slot) -> Option<Thing<'_>> {
        Some(Thing::object(self.scene.object(slot)?, self.scene.pose_at(slot)))
    }

    /// Visits pairs that may be nearer than `margin` and their padding, every pair once. Ends when
    /// `visit` returns false.
    pub(crate) fn visit(&self, state: &State, margin_m: f64, mut visit: impl FnMut(Candidate) -> bool) {
        let table = &self.scene.structure.table;
        let counts = |a: Slot, b: Slot| self.include_allowed || !table.is_allowed(a, b);
        for (i, moving) in self.moving.iter().enumerate() {
            let around = state.around(i);
            let (slot, error_m) = (moving.slot, state.error_m(i));
            for (j, other) in self.moving.iter().enumerate().skip(i + 1) {
                let threshold = margin_m + table.padding_m(slot, other.slot);
                let slack_m = error_m + state.error_m(j);
                let pair = Candidate { index: i, other: Other::Moving(j), threshold, slack_m };
                let both = (around, state.around(j));
                if may_be_within(both, threshold + slack_m, || counts(slot, other.slot)) && !visit(pair) {
                    return;
                }
            }
            match &self.still {
                Still::Few(others) => {
                    for (other, around_other) in others {
                        let threshold = margin_m + table.padding_m(slot, *other);
                        let pair = Candidate { index: i, other: Other::Standing(*other), threshold, slack_m: error_m };
                        let both = (around, around_other.as_ref());
                        if may_be_within(both, threshold + error_m, || counts(slot, *other)) && !visit(pair) {
                            return;
                        }
                    }
                }
                Still::Many(tree, places) => {
                    let reach = margin_m + table.largest_padding_m() + error_m;
                    let bounds = world_box(&moving.object, &state.poses[i]).map(|bounds| grown(&bounds, reach));
                    let met = bounds.iter().flat_map(|bounds| tree.meeting(bounds));
                    let half_spaces = self.scene.structure.half_spaces.iter().copied();
                    for other in met.chain(half_spaces).filter(|other| !places.contains_key(other)) {
                        let threshold = margin_m + table.padding_m(slot, other);
                        let pair = Candidate { index: i, other: Other::Standing(other), threshold, slack_m: error_m };
                        let around_other = self.standing(other).and_then(|thing| Around::new(&thing));
                        let both = (around, around_other.as_ref());
                        if may_be_within(both, threshold + error_m, || counts(slot, other)) && !visit(pair) {
                            return;
                        }
                    }
                }
            }
        }
    }
}

/// A pair that may be nearer than a threshold.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Candidate {
    /// Position of a moving object.
    pub(crate) index: usize,
    pub(crate) other: Other,
    /// Margin and padding, metres.
    pub(crate) threshold: f64,
    /// How far the two together may be from where exact arithmetic puts them, metres.
    pub(crate) slack_m: f64,
}

/// The other side of a pair with a moving object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Other {
    /// Another moving object, by its position.
    Moving(usize),
    /// What stands in a slot.
    Standing(Slot),
}

/// Whether a pair that counts may be nearer than a threshold, metres; what nothing contains always
/// may.
fn may_be_within((a, b): (Option<&Around>, Option<&Around>), threshold: f64, counts: impl FnOnce() -> bool) -> bool {
    let (Some(a), Some(b)) = (a, b) else { return counts() };
    a.is_near(b, threshold) && counts() && a.may_meet(b, threshold)
}
