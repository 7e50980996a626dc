//! From one snapshot to the next: an update is checked whole, then applied whole.

use std::collections::HashSet;
use std::sync::Arc;

use sublevel_core::body::BodyId;
use sublevel_core::measure::Pose;

use super::error::{Entry, List, Part, SceneError, entries};
use super::object::{Attachment, Object, Slot, Subject};
use super::poses::{compose, relative};
use super::rules::{SubjectPair, ordered};
use super::scene::Scene;
use super::structure::Structure;
use super::{Geometry, MAX_OBJECTS, MAX_PADDING_M, MAX_PAIR_RULES, MAX_ROBOTS, check_name};
use crate::robot::{FrameLink, NamedJointValues, PlaceRobot, check_names, move_robots, place_robots, remove_robots};

/// An object to add or to replace.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// Unique in its scene.
    pub name: Arc<str>,
    /// Id of the body it is made of.
    pub body: BodyId,
    /// Body frame to world frame, metres; none if it is held.
    pub pose: Option<Pose>,
    /// Free label, may be empty.
    pub group: Arc<str>,
    /// Padding of its own, metres.
    pub padding_m: Option<f64>,
    /// What holds it.
    pub attachment: Option<Attachment>,
}

/// An object to be held by another.
#[derive(Debug, Clone)]
pub struct Attach {
    /// The object.
    pub name: Arc<str>,
    /// Name of the object that holds it.
    pub to: Arc<str>,
    /// Frame of the held body to the frame of the holder, metres; none: it stays where it is in the
    /// world.
    pub pose: Option<Pose>,
    /// What it may touch besides its holder.
    pub touch: Vec<Subject>,
}

/// A set of changes that happen together. An object may be named once over `upserts`, `poses`,
/// `attach`, `detach` and `removals`, so that the order in which they are applied does not matter.
#[derive(Debug, Clone, Default)]
pub struct Update {
    /// When set, the update is for this revision only.
    pub expected_revision: Option<u64>,
    /// Objects to add, or to replace whole.
    pub upserts: Vec<Placement>,
    /// New poses (body frame to world frame, metres) of objects that are there.
    pub poses: Vec<(Arc<str>, Pose)>,
    /// Objects to remove, with their rules.
    pub removals: Vec<Arc<str>>,
    /// Pairs that may touch from now on.
    pub allow: Vec<SubjectPair>,
    /// Pairs that may not touch any more.
    pub forbid: Vec<SubjectPair>,
    /// Paddings of objects, metres.
    pub object_paddings: Vec<(Arc<str>, Option<f64>)>,
    /// Paddings of groups, metres.
    pub group_paddings: Vec<(Arc<str>, Option<f64>)>,
    /// Paddings of pairs, metres.
    pub pair_paddings: Vec<(SubjectPair, Option<f64>)>,
    /// Objects to be held from now on.
    pub attach: Vec<Attach>,
    /// Objects not to be held any more; each stays where it is.
    pub detach: Vec<Arc<str>>,
    /// Robots to place, or to replace whole.
    pub robots: Vec<PlaceRobot>,
    /// Joint values of robots that are there, by the names of the robots; joints not named keep
    /// theirs.
    pub joints: Vec<(Arc<str>, NamedJointValues)>,
    /// Base poses of robots that are there: root link to world frame, metres.
    pub bases: Vec<(Arc<str>, Pose)>,
    /// Robots to remove, with the objects of their links and the rules of these.
    pub robot_removals: Vec<Arc<str>>,
}

impl Update {
    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty() && self.joints.is_empty() && self.bases.is_empty() && self.keeps_structure()
    }

    /// Whether at most poses change, and joints and bases of robots.
    fn keeps_structure(&self) -> bool {
        self.upserts.is_empty()
            && self.removals.is_empty()
            && self.allow.is_empty()
            && self.forbid.is_empty()
            && self.object_paddings.is_empty()
            && self.group_paddings.is_empty()
            && self.pair_paddings.is_empty()
            && self.attach.is_empty()
            && self.detach.is_empty()
            && self.robots.is_empty()
            && self.robot_removals.is_empty()
    }

    /// Every object is named once over the lists that place objects, with a usable name.
    fn check_names(&self) -> Result<(), SceneError> {
        let mut seen = HashSet::new();
        let upserts = entries(List::Upserts, self.upserts.iter().map(|placement| &placement.name));
        let poses = entries(List::Poses, self.poses.iter().map(|(name, _)| name));
        let attach = entries(List::Attach, self.attach.iter().map(|attach| &attach.name));
        let detach = entries(List::Detach, self.detach.iter());
        let removals = entries(List::Removals, self.removals.iter());
        for (at, name) in upserts.chain(poses).chain(attach).chain(detach).chain(removals) {
            check_name(name).map_err(|error| SceneError::Name { at, error })?;
            if !seen.insert(name) {
                return Err(SceneError::Twice { at, name: name.clone() });
            }
        }
        Ok(())
    }

    fn check_paddings(&self) -> Result<(), SceneError> {
        let upserts = entries(List::Upserts, self.upserts.iter().map(|placement| placement.padding_m));
        let objects = entries(List::ObjectPaddings, self.object_paddings.iter().map(|(_, padding)| *padding));
        let groups = entries(List::GroupPaddings, self.group_paddings.iter().map(|(_, padding)| *padding));
        let pairs = entries(List::PairPaddings, self.pair_paddings.iter().map(|(_, padding)| *padding));
        for (at, padding) in upserts.chain(objects).chain(groups).chain(pairs) {
            // Not `>`: a NaN is refused too.
            if let Some(padding_m) = padding.filter(|padding| !(padding.abs() <= MAX_PADDING_M)) {
                return Err(SceneError::Padding { at, padding_m });
            }
        }
        Ok(())
    }
}

impl Scene {
    /// The next snapshot: this one with all of `update` applied and the revision grown by one; a
    /// plain copy when the update is empty. `bodies` looks a body up by its id.
    ///
    /// # Errors
    /// The first entry that cannot be applied; then nothing is.
    pub fn updated(&self, update: &Update, bodies: impl Fn(&BodyId) -> Option<Geometry>) -> Result<Self, SceneError> {
        if let Some(expected) = update.expected_revision.filter(|expected| *expected != self.revision()) {
            return Err(SceneError::Revision { expected, current: self.revision() });
        }
        if update.is_empty() {
            return Ok(self.clone());
        }
        update.check_names()?;
        check_names((&update.robots, &update.robot_removals), &update.joints, &update.bases)?;
        update.check_paddings()?;
        if update.keeps_structure() {
            let mut moved = Vec::with_capacity(update.poses.len());
            for (at, (name, pose)) in entries(List::Poses, &update.poses) {
                moved.push((find_own(&self.structure, at, name)?, *pose));
            }
            let mut next = self.next();
            moved.extend(move_robots(&self.structure, &mut next, &update.joints, &update.bases)?);
            return next.moved(&moved);
        }
        self.restructured(update, bodies)
    }

    /// The next snapshot with other world poses of objects that are there; what they hold moves
    /// along. Of an object that is held this changes its place in its holder.
    ///
    /// # Errors
    /// A held object that would end up too far away to have a pose, and the link of a robot.
    pub fn with_poses(&self, moved: &[(Slot, Pose)]) -> Result<Self, SceneError> {
        for (at, (slot, _)) in entries(List::Poses, moved) {
            check_own(&self.structure, at, *slot)?;
        }
        self.next().moved(moved)
    }

    /// This snapshot, which nobody has seen yet, with other poses.
    fn moved(self, moved: &[(Slot, Pose)]) -> Result<Self, SceneError> {
        let mut next = self;
        let mut changed: Vec<Slot> = moved.iter().map(|(slot, _)| *slot).collect();
        for &(slot, pose) in moved {
            next.set_pose(slot, pose);
        }
        let before = next.structure.clone();
        let held = before.held_by(&changed);
        changed.extend(follow(&before, &mut next, &held)?);
        let is_held = |slot: Slot| before.object(slot).is_some_and(|object| object.attachment.is_some());
        if moved.iter().any(|(slot, _)| is_held(*slot)) {
            // Now that holders are where they will be.
            let mut structure = Structure::clone(&before);
            keep_places(&mut structure, &next, moved)?;
            let slots: Vec<Slot> = moved.iter().map(|(slot, _)| *slot).collect();
            let held = slots.iter().copied().filter(|slot| is_held(*slot)).chain(structure.held_by(&slots));
            let held: Vec<Slot> = held.collect();
            changed.extend(follow(&structure, &mut next, &held)?);
            next.set_structure(structure);
        }
        next.set_changed(&changed);
        Ok(next)
    }

    /// This snapshot, at its revision, with other world poses of some objects for one call; what
    /// they hold moves along unless it is named itself.
    ///
    /// # Errors
    /// A held object that would end up too far away to have a pose.
    pub fn posed(&self, poses: &[(Slot, Pose)]) -> Result<Self, SceneError> {
        let mut posed = self.clone();
        let mut changed: Vec<Slot> = poses.iter().map(|(slot, _)| *slot).collect();
        for &(slot, pose) in poses {
            posed.set_pose(slot, pose);
        }
        let mut held = self.structure.held_by(&changed);
        held.retain(|slot| !changed.contains(slot));
        changed.extend(follow(&self.structure, &mut posed, &held)?);
        posed.set_changed(&changed);
        Ok(posed)
    }

    fn restructured(&self, update: &Update, bodies: impl Fn(&BodyId) -> Option<Geometry>) -> Result<Self, SceneError> {
        let mut structure = Structure::clone(&self.structure);
        let mut next = self.next();
        let mut changed = remove_robots(&mut structure, &mut next, &update.robot_removals)?;
        for (at, name) in entries(List::Removals, &update.removals) {
            if let Some(slot) = structure.slot(name) {
                check_own(&structure, at, slot)?;
            }
            let slot = structure.remove(name).ok_or_else(|| SceneError::NoObject { at, name: name.clone() })?;
            next.clear_pose(slot);
            changed.push(slot);
        }
        if !update.removals.is_empty() {
            let removed: HashSet<&str> = update.removals.iter().map(|name| &**name).collect();
            structure.forget(|name| removed.contains(name));
        }
        for (at, placement) in entries(List::Upserts, &update.upserts) {
            if let Some(slot) = structure.slot(&placement.name) {
                check_own(&structure, at, slot)?;
            }
            let slot = structure.put(place(at, placement, &bodies)?);
            changed.push(slot);
            match (placement.pose, &placement.attachment) {
                (_, Some(_)) => {}
                (Some(pose), None) => next.set_pose(slot, pose),
                (None, None) => return Err(SceneError::NoPose { at, name: placement.name.clone() }),
            }
        }
        changed.extend(place_robots(&mut structure, &mut next, &update.robots)?);
        for (at, name) in entries(List::Detach, &update.detach) {
            let slot = find_own(&structure, at, name)?;
            structure.change(slot, |object| object.attachment = None);
        }
        let mut moved = Vec::with_capacity(update.poses.len());
        for (at, (name, pose)) in entries(List::Poses, &update.poses) {
            let slot = find_own(&structure, at, name)?;
            next.set_pose(slot, *pose);
            moved.push((slot, *pose));
            changed.push(slot);
        }
        for (slot, pose) in move_robots(&structure, &mut next, &update.joints, &update.bases)? {
            next.set_pose(slot, pose);
            changed.push(slot);
        }
        check_placed_holders(&structure, &update.upserts)?;
        // What is held follows its holder before anything looks for its place in one.
        structure.derive();
        check_holders(&structure)?;
        changed.extend(follow_all(&structure, &mut next)?);
        keep_places(&mut structure, &next, &moved)?;
        attach(&mut structure, &next, update)?;
        apply_rules(&mut structure, update)?;
        structure.derive();
        check_holders(&structure)?;
        within("objects", structure.by_name.len(), MAX_OBJECTS)?;
        within("robots", structure.robots.len(), MAX_ROBOTS)?;
        within("allowed pairs", structure.rules.allowed.len(), MAX_PAIR_RULES)?;
        within("pairs with a padding", structure.rules.pairs.len(), MAX_PAIR_RULES)?;
        changed.extend(follow_all(&structure, &mut next)?);
        next.set_structure(structure);
        next.set_changed(&changed);
        Ok(next)
    }
}

/// Held objects that were moved by themselves keep where they are: their places in their holders
/// change.
fn keep_places(structure: &mut Structure, next: &Scene, moved: &[(Slot, Pose)]) -> Result<(), SceneError> {
    for &(slot, pose) in moved {
        let Some(object) = structure.object(slot) else { continue };
        let (Some(attachment), name) = (&object.attachment, object.name.clone()) else { continue };
        let Some(holder) = structure.slot(&attachment.to) else { continue };
        let place = relative(next.pose_at(holder), &pose).map_err(|error| SceneError::Pose { name, error })?;
        structure.change(slot, |object| {
            if let Some(attachment) = &mut object.attachment {
                attachment.pose = place;
            }
        });
    }
    Ok(())
}

/// Sets the poses of everything that is held, see [`follow`].
fn follow_all(structure: &Structure, next: &mut Scene) -> Result<Vec<Slot>, SceneError> {
    let is_free = |slot: &Slot| structure.object(*slot).is_some_and(|object| object.attachment.is_none());
    let roots: Vec<Slot> = structure.holding.keys().copied().filter(is_free).collect();
    follow(structure, next, &structure.held_by(&roots))
}

/// Sets the poses of held objects, each listed after its holder, and returns which have changed.
fn follow(structure: &Structure, next: &mut Scene, held: &[Slot]) -> Result<Vec<Slot>, SceneError> {
    let mut changed = Vec::new();
    for &slot in held {
        let Some(object) = structure.object(slot) else { continue };
        let Some(attachment) = &object.attachment else { continue };
        let Some(holder) = structure.slot(&attachment.to) else { continue };
        let pose = compose(next.pose_at(holder), &attachment.pose)
            .map_err(|error| SceneError::Pose { name: object.name.clone(), error })?;
        if !next.has_pose(slot) || *next.pose_at(slot) != pose {
            next.set_pose(slot, pose);
            changed.push(slot);
        }
    }
    Ok(changed)
}

fn attach(structure: &mut Structure, next: &Scene, update: &Update) -> Result<(), SceneError> {
    for (at, attach) in entries(List::Attach, &update.attach) {
        let slot = find_own(structure, at, &attach.name)?;
        let holder = find_holder(structure, at, (&attach.name, &attach.to))?;
        check_touch(structure, at, &attach.touch)?;
        let pose = match attach.pose {
            Some(pose) => pose,
            None if !next.has_pose(holder) => return Err(SceneError::NoPlace { at, name: attach.to.clone() }),
            None => relative(next.pose_at(holder), next.pose_at(slot))
                .map_err(|error| SceneError::Pose { name: attach.name.clone(), error })?,
        };
        let attachment = Attachment { to: attach.to.clone(), pose, touch: attach.touch.clone() };
        structure.change(slot, |object| object.attachment = Some(attachment));
    }
    Ok(())
}

/// What placed objects are held by, and may touch, is there.
fn check_placed_holders(structure: &Structure, placements: &[Placement]) -> Result<(), SceneError> {
    for (at, placement) in entries(List::Upserts, placements) {
        if let Some(attachment) = &placement.attachment {
            find_holder(structure, at, (&placement.name, &attachment.to))?;
            check_touch(structure, at, &attachment.touch)?;
        }
    }
    Ok(())
}

fn apply_rules(structure: &mut Structure, update: &Update) -> Result<(), SceneError> {
    for (at, (name, padding)) in entries(List::ObjectPaddings, &update.object_paddings) {
        let slot = find(structure, at, name)?;
        structure.change(slot, |object| object.padding_m = *padding);
    }
    for (at, (group, padding)) in entries(List::GroupPaddings, &update.group_paddings) {
        check_name(group).map_err(|error| SceneError::Name { at, error })?;
        match padding {
            Some(padding) => structure.rules.groups.insert(group.clone(), *padding),
            None => structure.rules.groups.remove(group),
        };
    }
    for (at, pair) in entries(List::Allow, &update.allow) {
        let pair = checked(structure, at, pair)?;
        structure.rules.allowed.insert(pair);
    }
    for (at, pair) in entries(List::Forbid, &update.forbid) {
        let pair = checked(structure, at, pair)?;
        structure.rules.allowed.remove(&pair);
    }
    for (at, (pair, padding)) in entries(List::PairPaddings, &update.pair_paddings) {
        let pair = checked(structure, at, pair)?;
        match padding {
            Some(padding) => structure.rules.pairs.insert(pair, *padding),
            None => structure.rules.pairs.remove(&pair),
        };
    }
    Ok(())
}

/// A pair of two different objects of the scene, or of groups, in the order it is kept.
fn checked(structure: &Structure, at: Entry, (a, b): &SubjectPair) -> Result<SubjectPair, SceneError> {
    check_subject(structure, at, a)?;
    check_subject(structure, at, b)?;
    match (a, b) {
        (Subject::Object(a), Subject::Object(b)) if a == b => Err(SceneError::Itself { at, name: a.clone() }),
        (a, b) => Ok(ordered((a.clone(), b.clone()))),
    }
}

/// What a held object may touch can be named.
fn check_touch(structure: &Structure, at: Entry, touch: &[Subject]) -> Result<(), SceneError> {
    let mut subjects = touch.iter().enumerate();
    subjects.try_for_each(|(index, subject)| check_subject(structure, at.part(Part::Touch(index)), subject))
}

/// An object is there, a group has a usable name.
fn check_subject(structure: &Structure, at: Entry, subject: &Subject) -> Result<(), SceneError> {
    match subject {
        Subject::Object(name) => find(structure, at, name).map(|_| ()),
        Subject::Group(name) => check_name(name).map_err(|error| SceneError::Name { at, error }),
    }
}

/// The object that is to hold another one.
fn find_holder(structure: &Structure, at: Entry, (held, to): (&Arc<str>, &Arc<str>)) -> Result<Slot, SceneError> {
    let at = at.part(Part::Holder);
    if structure.slot(to).is_none()
        && let Some(FrameLink { link, robot, holder }) = FrameLink::named(&structure.robots, to)
    {
        return Err(SceneError::FrameLink { at, link, robot, instead: holder });
    }
    let holder = find(structure, at, to)?;
    if held == to { Err(SceneError::Itself { at, name: held.clone() }) } else { Ok(holder) }
}

/// Nothing is held by itself or by an object that is gone.
fn check_holders(structure: &Structure) -> Result<(), SceneError> {
    if let Some(name) = structure.circle() {
        return Err(SceneError::Circle { name: name.clone() });
    }
    for (_, object) in structure.objects() {
        if let Some(attachment) = &object.attachment
            && structure.slot(&attachment.to).is_none()
        {
            return Err(SceneError::Holds { name: attachment.to.clone(), held: object.name.clone() });
        }
    }
    Ok(())
}

fn place(at: Entry, placement: &Placement, bodies: impl Fn(&BodyId) -> Option<Geometry>) -> Result<Object, SceneError> {
    let Placement { name, body: id, group, padding_m, attachment, .. } = placement;
    if !group.is_empty() && check_name(group).is_err() {
        return Err(SceneError::Group { at });
    }
    let geometry = bodies(id).ok_or(SceneError::NoBody { at, id: *id })?;
    Ok(Object::new(name.clone(), geometry, group.clone(), *padding_m, attachment.clone()))
}

fn find(structure: &Structure, at: Entry, name: &Arc<str>) -> Result<Slot, SceneError> {
    check_name(name).map_err(|error| SceneError::Name { at, error })?;
    structure.slot(name).ok_or_else(|| SceneError::NoObject { at, name: name.clone() })
}

/// An object that is no link of a robot.
fn find_own(structure: &Structure, at: Entry, name: &Arc<str>) -> Result<Slot, SceneError> {
    let slot = find(structure, at, name)?;
    check_own(structure, at, slot)?;
    Ok(slot)
}

/// Links of robots are not changed one by one.
fn check_own(structure: &Structure, at: Entry, slot: Slot) -> Result<(), SceneError> {
    let Some(object) = structure.object(slot) else { return Ok(()) };
    match &object.link {
        Some(of) => Err(SceneError::OfRobot { at, name: object.name.clone(), robot: of.robot.clone() }),
        None => Ok(()),
    }
}

fn within(what: &'static str, count: usize, limit: usize) -> Result<(), SceneError> {
    if count <= limit { Ok(()) } else { Err(SceneError::Full { what, count, limit }) }
}
