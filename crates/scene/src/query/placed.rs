//! Many states of the same objects: who stands where in each, and which pairs may be near.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::measure::Pose;

use super::thing::{Thing, ball_gap};
use crate::broad_phase::{Tree, WorldBall, grown, world_box};
use crate::object::{Object, Slot};
use crate::pair_cache::PairCache;
use crate::poses::compose;
use crate::scene::Scene;

/// Poses of one object in a packed state: translation, then quaternion x y z w.
pub(crate) const POSE_NUMBERS: usize = 7;

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

/// Objects that every state places, and all others.
#[derive(Debug)]
pub(crate) struct Placed {
    scene: Scene,
    /// Placed objects as they are named, then what they hold, each after its holder.
    moving: Vec<Moving>,
    /// How many of them are named.
    named: usize,
    /// Packed poses, state after state.
    poses: Vec<f64>,
    still: Still,
    include_allowed: bool,
}

#[derive(Debug)]
struct Moving {
    slot: Slot,
    object: Arc<Object>,
    /// Position of what holds it among the moving, and its place there; none if it is named.
    holder: Option<(usize, Pose)>,
}

/// What stands still.
#[derive(Debug)]
enum Still {
    /// Few: all of them, with their balls; none around half-spaces.
    Few(Vec<(Slot, Option<WorldBall>)>),
    /// Many: the tree, and which of its leaves move.
    Many(Arc<Tree>, HashMap<Slot, usize>),
}

/// Why states cannot be placed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StatesError {
    /// No object.
    #[error("is empty; name the objects that the states place")]
    NoObject,
    /// An object twice.
    #[error("object {0} is named twice; name it once")]
    Twice(usize),
    /// Numbers that are not whole states.
    #[error("holds {numbers} numbers, which is no multiple of {per_state}: 7 for each of {objects} objects")]
    Numbers {
        /// How many there are.
        numbers: usize,
        /// How many make a state.
        per_state: usize,
        /// Number of objects.
        objects: usize,
    },
    /// No state.
    #[error("is empty; send at least one state")]
    NoState,
}

impl Placed {
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
        let (mut moving, mut places) = (Vec::new(), HashMap::new());
        for (index, &slot) in slots.iter().enumerate() {
            if places.insert(slot, index).is_some() {
                return Err(StatesError::Twice(index));
            }
            if let Some(object) = scene.object(slot) {
                moving.push(Moving { slot, object: object.clone(), holder: None });
            }
        }
        let named = moving.len();
        for slot in scene.held_by(slots) {
            if places.contains_key(&slot) {
                continue;
            }
            let Some(object) = scene.object(slot) else { continue };
            let Some(attachment) = &object.attachment else { continue };
            let Some(&holder) = scene.slot(&attachment.to).and_then(|holder| places.get(&holder)) else { continue };
            places.insert(slot, moving.len());
            moving.push(Moving { slot, object: object.clone(), holder: Some((holder, attachment.pose)) });
        }
        let standing = scene.len() - moving.len();
        let still = if standing <= FEW {
            let others = scene.objects().filter(|(slot, _, _)| !places.contains_key(slot));
            Still::Few(others.map(|(slot, object, pose)| (slot, Thing::object(object, pose).ball())).collect())
        } else {
            Still::Many(scene.tree().clone(), places)
        };
        Ok(Self { scene, moving, named, poses, still, include_allowed })
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of states.
    pub(crate) fn states(&self) -> usize {
        self.poses.len() / (self.named * POSE_NUMBERS)
    }

    /// World poses of all moving objects in a state; none if a number is no pose.
    pub(crate) fn poses(&self, state: usize, poses: &mut Vec<Pose>) -> Option<()> {
        poses.clear();
        let from = state * self.named * POSE_NUMBERS;
        let numbers = &self.poses[from..from + self.named * POSE_NUMBERS];
        for pose in numbers.as_chunks::<POSE_NUMBERS>().0 {
            let &[x, y, z, i, j, k, w] = pose;
            poses.push(Pose::from_quaternion(Vector3::new(x, y, z), [i, j, k, w]).ok()?);
        }
        for moving in &self.moving[self.named..] {
            let (holder, place) = moving.holder.as_ref()?;
            poses.push(compose(&poses[*holder], place).ok()?);
        }
        Some(())
    }

    /// The thing that a moving object is at a pose.
    pub(crate) fn moving<'a>(&'a self, index: usize, poses: &'a [Pose]) -> (Slot, Thing<'a>) {
        self.moving_at(index, &poses[index])
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

    /// Visits pairs that may be nearer than `margin` and their padding, every pair once: a moving
    /// object by its position, and another one of them, or what stands in a slot. Ends when
    /// `visit` returns false.
    pub(crate) fn visit(&self, poses: &[Pose], margin_m: f64, mut visit: impl FnMut(usize, Other, f64) -> bool) {
        let table = &self.scene.structure.table;
        let counts = |a: Slot, b: Slot| self.include_allowed || !table.is_allowed(a, b);
        let balls: Vec<_> = (0..self.moving.len()).map(|index| self.moving(index, poses).1.ball()).collect();
        for (i, moving) in self.moving.iter().enumerate() {
            let slot = moving.slot;
            for (j, other) in self.moving.iter().enumerate().skip(i + 1) {
                let threshold = margin_m + table.padding_m(slot, other.slot);
                if near(&balls[i], &balls[j], threshold)
                    && counts(slot, other.slot)
                    && !visit(i, Other::Moving(j), threshold)
                {
                    return;
                }
            }
            match &self.still {
                Still::Few(others) => {
                    for (other, ball) in others {
                        let threshold = margin_m + table.padding_m(slot, *other);
                        if near(&balls[i], ball, threshold)
                            && counts(slot, *other)
                            && !visit(i, Other::Standing(*other), threshold)
                        {
                            return;
                        }
                    }
                }
                Still::Many(tree, places) => {
                    let reach = margin_m + table.largest_padding_m();
                    let around = world_box(&moving.object, &poses[i]).map(|around| grown(&around, reach));
                    let met = around.iter().flat_map(|around| tree.meeting(around));
                    let half_spaces = self.scene.structure.half_spaces.iter().copied();
                    for other in met.chain(half_spaces).filter(|other| !places.contains_key(other)) {
                        let threshold = margin_m + table.padding_m(slot, other);
                        if counts(slot, other) && !visit(i, Other::Standing(other), threshold) {
                            return;
                        }
                    }
                }
            }
        }
    }
}

/// The other side of a pair with a moving object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Other {
    /// Another moving object, by its position.
    Moving(usize),
    /// What stands in a slot.
    Standing(Slot),
}

fn near(a: &Option<WorldBall>, b: &Option<WorldBall>, threshold: f64) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => ball_gap(*a, *b) <= threshold,
        _ => true,
    }
}
