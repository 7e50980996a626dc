//! One scene at one revision.

use std::collections::BTreeMap;
use std::sync::Arc;

use sublevel_core::measure::Pose;

use super::broad_phase::{BroadPhase, Tree};
use super::object::{Object, Slot};
use super::pair_cache::PairCache;
use super::poses::Poses;
use super::rules::{Rules, SubjectPair};
use super::structure::Structure;
use super::{NameError, check_name};
use crate::robot::{RobotInstance, Stance};

/// An immutable snapshot of a scene. Cloning takes constant time and shares everything; so does
/// [`Scene::fork`].
#[derive(Debug, Clone)]
pub struct Scene {
    name: Arc<str>,
    revision: u64,
    /// Revision at which anything but poses last changed.
    structure_revision: u64,
    pub(crate) structure: Arc<Structure>,
    poses: Poses,
    /// Bases and joint values of robots, by name.
    stances: Arc<BTreeMap<Arc<str>, Arc<Stance>>>,
    broad_phase: Arc<BroadPhase>,
    /// Warm starts, shared by all snapshots and forks.
    pub(crate) cache: Arc<PairCache>,
}

impl Scene {
    /// An empty scene at the given revision.
    ///
    /// # Errors
    /// When the name is not usable, see [`check_name`].
    pub fn new(name: &str, revision: u64) -> Result<Self, NameError> {
        check_name(name)?;
        Ok(Self {
            name: name.into(),
            revision,
            structure_revision: revision,
            structure: Arc::default(),
            poses: Poses::default(),
            stances: Arc::default(),
            broad_phase: Arc::default(),
            cache: Arc::default(),
        })
    }

    /// The same snapshot under another name.
    ///
    /// # Errors
    /// When the name is not usable.
    pub fn fork(&self, name: &str) -> Result<Self, NameError> {
        check_name(name)?;
        Ok(Self { name: name.into(), ..self.clone() })
    }

    /// The content of this fork, as the next revision of its parent: one above both.
    pub fn committed_to(&self, parent: &Self) -> Self {
        let revision = self.revision.max(parent.revision) + 1;
        Self { name: parent.name.clone(), revision, structure_revision: revision, ..self.clone() }
    }

    /// The same with another revision, which was given out already; for what was read from disk.
    pub fn at_revision(self, revision: u64) -> Self {
        Self { revision, structure_revision: revision, ..self }
    }

    /// Its name.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// Grows with every change and never goes back.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Revision at which anything but poses last changed.
    pub fn structure_revision(&self) -> u64 {
        self.structure_revision
    }

    /// Number of objects.
    pub fn len(&self) -> usize {
        self.structure.by_name.len()
    }

    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.structure.by_name.is_empty()
    }

    /// Slot of an object by its name.
    pub fn slot(&self, name: &str) -> Option<Slot> {
        self.structure.slot(name)
    }

    /// The object in a slot.
    pub fn object(&self, slot: Slot) -> Option<&Arc<Object>> {
        self.structure.object(slot)
    }

    /// World pose of an object: body frame to world frame, metres.
    pub fn pose(&self, slot: Slot) -> Option<&Pose> {
        self.object(slot).map(|_| self.poses.get(slot))
    }

    /// Slots, objects and world poses in the order of names.
    pub fn objects(&self) -> impl DoubleEndedIterator<Item = (Slot, &Arc<Object>, &Pose)> {
        self.structure.objects().map(|(slot, object)| (slot, object, self.poses.get(slot)))
    }

    /// The same from the first name after `name`.
    pub fn objects_after(&self, name: &str) -> impl Iterator<Item = (Slot, &Arc<Object>, &Pose)> {
        let from = (std::ops::Bound::Excluded(name), std::ops::Bound::Unbounded);
        let slots = self.structure.by_name.range::<str, _>(from).map(|(_, &slot)| slot);
        slots.filter_map(|slot| Some((slot, self.object(slot)?, self.poses.get(slot))))
    }

    /// Slots whose pose was set after a revision, in the order of slots.
    pub fn moved_since(&self, revision: u64) -> impl Iterator<Item = Slot> {
        let slots = (0..).zip(&self.structure.slots).filter(|(_, object)| object.is_some()).map(|(slot, _)| slot);
        slots.filter(move |&slot| self.poses.stamp(slot) > revision)
    }

    /// Number of robots.
    pub fn robot_count(&self) -> usize {
        self.structure.robots.len()
    }

    /// Robots in the order of their names.
    pub fn robots(&self) -> impl DoubleEndedIterator<Item = RobotInstance<'_>> {
        self.structure.robots.iter().filter_map(|(name, instance)| {
            let stance = self.stances.get(name)?;
            Some(RobotInstance { name, instance, stance })
        })
    }

    /// The robot of a name.
    pub fn robot(&self, name: &str) -> Option<RobotInstance<'_>> {
        let (name, instance) = self.structure.robots.get_key_value(name)?;
        Some(RobotInstance { name, instance, stance: self.stances.get(name)? })
    }

    /// Pairs that may touch, and paddings, as they were set.
    pub fn rules(&self) -> &Rules {
        &self.structure.rules
    }

    /// Whether nothing but poses differs from `before`, an earlier snapshot of this scene. Takes no
    /// time.
    pub fn same_structure(&self, before: &Self) -> bool {
        Arc::ptr_eq(&self.structure, &before.structure)
    }

    /// Whether two objects may touch.
    pub fn is_allowed(&self, a: Slot, b: Slot) -> bool {
        self.structure.table.is_allowed(a, b)
    }

    /// What is added to the margins of a pair, metres.
    pub fn padding_m(&self, a: Slot, b: Slot) -> f64 {
        self.structure.table.padding_m(a, b)
    }

    /// Slots of everything that these objects hold, directly or not.
    pub fn held_by(&self, slots: &[Slot]) -> Vec<Slot> {
        self.structure.held_by(slots)
    }

    /// The tree of boxes, made where it is not there yet.
    pub(crate) fn tree(&self) -> &Arc<Tree> {
        self.broad_phase.tree(&self.structure, &self.poses)
    }

    /// The same snapshot with another table of warm starts.
    pub(crate) fn with_cache(&self, cache: Arc<PairCache>) -> Self {
        Self { cache, ..self.clone() }
    }

    /// A snapshot one revision on that still holds the same.
    pub(crate) fn next(&self) -> Self {
        Self { revision: self.revision + 1, ..self.clone() }
    }

    pub(crate) fn pose_at(&self, slot: Slot) -> &Pose {
        self.poses.get(slot)
    }

    /// Whether a pose of the slot was ever set.
    pub(crate) fn has_pose(&self, slot: Slot) -> bool {
        self.poses.has(slot)
    }

    /// Sets one pose; [`Scene::set_changed`] is to follow.
    pub(crate) fn set_pose(&mut self, slot: Slot, pose: Pose) {
        self.poses.set([(slot, pose)], self.revision);
    }

    /// Base and joint values of a robot.
    pub(crate) fn stance(&self, robot: &str) -> Option<&Stance> {
        self.stances.get(robot).map(|stance| &**stance)
    }

    /// Sets base and joint values of a robot, or forgets them.
    pub(crate) fn set_stance(&mut self, robot: &Arc<str>, stance: Option<Stance>) {
        let stances = Arc::make_mut(&mut self.stances);
        match stance {
            Some(stance) => stances.insert(robot.clone(), Arc::new(stance)),
            None => stances.remove(robot),
        };
    }

    /// Forgets the pose of an object that is gone.
    pub(crate) fn clear_pose(&mut self, slot: Slot) {
        self.poses.clear(slot);
    }

    /// What is in these slots, or where it is, has changed.
    pub(crate) fn set_changed(&mut self, slots: &[Slot]) {
        self.broad_phase = Arc::new(self.broad_phase.after(slots));
    }

    pub(crate) fn set_structure(&mut self, structure: Structure) {
        self.structure = Arc::new(structure);
        self.structure_revision = self.revision;
    }
}

impl Rules {
    /// Pairs that may touch, in order.
    pub fn allowed(&self) -> impl ExactSizeIterator<Item = &SubjectPair> {
        self.allowed.iter()
    }

    /// Paddings of groups, metres, in the order of their names.
    pub fn group_paddings(&self) -> impl ExactSizeIterator<Item = (&Arc<str>, f64)> {
        self.groups.iter().map(|(group, padding)| (group, *padding))
    }

    /// Paddings of pairs, metres, in order.
    pub fn pair_paddings(&self) -> impl ExactSizeIterator<Item = (&SubjectPair, f64)> {
        self.pairs.iter().map(|(pair, padding)| (pair, *padding))
    }
}
