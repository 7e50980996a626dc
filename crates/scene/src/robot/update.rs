//! Changes of robots in a scene.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use nalgebra::Isometry3;
use sublevel_core::measure::Pose;

use super::{Instance, NamedJointValues, PlaceRobot, Stance, isometry, pose_of, with_values};
use crate::check_name;
use crate::error::{Entry, List, SceneError, entries};
use crate::object::{LinkOf, Object, Slot};
use crate::scene::Scene;
use crate::structure::Structure;

/// A robot is placed or removed once, and then neither its joints nor its base are set; these once
/// each.
pub(crate) fn check_names(
    (robots, removals): (&[PlaceRobot], &[Arc<str>]),
    joints: &[(Arc<str>, NamedJointValues)],
    bases: &[(Arc<str>, Pose)],
) -> Result<(), SceneError> {
    let (mut whole, mut with_joints, mut with_bases) = (HashSet::new(), HashSet::new(), HashSet::new());
    let twice = |at: Entry, name: &Arc<str>| SceneError::RobotTwice { at, name: name.clone() };
    let placed = entries(List::Robots, robots.iter().map(|placed| &placed.name));
    for (at, name) in placed.chain(entries(List::RobotRemovals, removals)) {
        check_name(name).map_err(|error| SceneError::Name { at, error })?;
        if !whole.insert(name) {
            return Err(twice(at, name));
        }
    }
    let joints = entries(List::Joints, joints.iter().map(|(name, _)| name));
    let bases = entries(List::Bases, bases.iter().map(|(name, _)| name));
    for (at, name) in joints.chain(bases) {
        check_name(name).map_err(|error| SceneError::Name { at, error })?;
        let seen = if at.list == List::Joints { &mut with_joints } else { &mut with_bases };
        if whole.contains(name) || !seen.insert(name) {
            return Err(twice(at, name));
        }
    }
    Ok(())
}

/// Removes robots with the objects of their links.
pub(crate) fn remove_robots(
    structure: &mut Structure,
    next: &mut Scene,
    removals: &[Arc<str>],
) -> Result<Vec<Slot>, SceneError> {
    let (mut changed, mut gone) = (Vec::new(), HashSet::new());
    for (at, name) in entries(List::RobotRemovals, removals) {
        let instance = structure.robots.remove(name).ok_or_else(|| no_robot(at, name))?;
        next.set_stance(name, None);
        for slot in instance.slots.iter().flatten() {
            changed.extend(take(structure, next, *slot, &mut gone));
        }
    }
    structure.forget(|name| gone.contains(name));
    Ok(changed)
}

/// Places robots, or replaces them whole: links of one name keep their slots, and with these what
/// they hold and what rules say of them.
pub(crate) fn place_robots(
    structure: &mut Structure,
    next: &mut Scene,
    robots: &[PlaceRobot],
) -> Result<Vec<Slot>, SceneError> {
    let (mut changed, mut gone) = (Vec::new(), HashSet::new());
    for (at, placed) in entries(List::Robots, robots) {
        let PlaceRobot { name, robot, base, joints } = placed;
        let kinematics = robot.kinematics();
        let configuration = with_values(kinematics, kinematics.default_configuration(), joints)
            .map_err(|error| SceneError::Joints { at, error })?;
        let before = structure.robots.remove(name).map(|instance| instance.slots.clone()).unwrap_or_default();
        let mut slots = Vec::with_capacity(robot.links().len());
        for (link, (of, link_name)) in robot.links().iter().zip(kinematics.links()).enumerate() {
            let Some(of) = of else {
                slots.push(None);
                continue;
            };
            let object: Arc<str> = format!("{name}/{link_name}").into();
            check_name(&object).map_err(|error| SceneError::LinkName { at, name: object.clone(), error })?;
            if structure.slot(&object).is_some_and(|slot| !before.contains(&Some(slot))) {
                return Err(SceneError::NameTaken { at, name: object, robot: name.clone() });
            }
            let mut object = Object::new(object, of.geometry.clone(), name.clone(), None, None);
            object.link = Some(LinkOf { robot: name.clone(), link });
            slots.push(Some(structure.put(object)));
        }
        for slot in before.into_iter().flatten().filter(|slot| !slots.contains(&Some(*slot))) {
            changed.extend(take(structure, next, slot, &mut gone));
        }
        let stance = Stance { base: *base, configuration, stamp: next.revision() };
        let instance = Arc::new(Instance { robot: robot.clone(), slots });
        changed.extend(instance.slots.iter().flatten());
        for (slot, pose) in link_poses(at, &instance, name, &stance)? {
            next.set_pose(slot, pose);
        }
        next.set_stance(name, Some(stance));
        structure.robots.insert(name.clone(), instance);
    }
    structure.forget(|name| gone.contains(name));
    Ok(changed)
}

/// Sets joints and bases, and returns the poses of links that follow from it and differ from where
/// they were.
pub(crate) fn move_robots(
    structure: &Structure,
    next: &mut Scene,
    joints: &[(Arc<str>, NamedJointValues)],
    bases: &[(Arc<str>, Pose)],
) -> Result<Vec<(Slot, Pose)>, SceneError> {
    let mut stances: BTreeMap<&Arc<str>, (Entry, &Instance, Stance)> = BTreeMap::new();
    for (at, (name, base)) in entries(List::Bases, bases) {
        let (instance, stance) = find(structure, next, at, name)?;
        stances.insert(name, (at, instance, Stance { base: *base, ..stance }));
    }
    for (at, (name, values)) in entries(List::Joints, joints) {
        let (instance, stance) = match stances.remove(name) {
            Some((_, instance, stance)) => (instance, stance),
            None => find(structure, next, at, name)?,
        };
        let configuration = with_values(instance.robot.kinematics(), stance.configuration, values)
            .map_err(|error| SceneError::Joints { at, error })?;
        stances.insert(name, (at, instance, Stance { configuration, ..stance }));
    }
    let mut moved = Vec::new();
    for (name, (at, instance, stance)) in stances {
        let stance = Stance { stamp: next.revision(), ..stance };
        let poses = link_poses(at, instance, name, &stance)?;
        moved.extend(poses.into_iter().filter(|(slot, pose)| next.pose_at(*slot) != pose));
        next.set_stance(name, Some(stance));
    }
    Ok(moved)
}

/// World poses of the objects of a robot's links.
fn link_poses(at: Entry, instance: &Instance, name: &str, stance: &Stance) -> Result<Vec<(Slot, Pose)>, SceneError> {
    let (kinematics, mut links) = (instance.robot.kinematics(), Vec::<Isometry3<f64>>::new());
    kinematics.forward(&isometry(&stance.base), &stance.configuration, &mut links);
    let mut poses = Vec::with_capacity(links.len());
    for (link, slot) in instance.slots.iter().enumerate() {
        let Some(slot) = slot else { continue };
        let pose = pose_of(&links[link]).map_err(|error| {
            let name = format!("{name}/{}", kinematics.links()[link]).into();
            SceneError::LinkPose { at, name, error }
        })?;
        poses.push((*slot, pose));
    }
    Ok(poses)
}

/// Removes the object in a slot.
fn take(structure: &mut Structure, next: &mut Scene, slot: Slot, gone: &mut HashSet<String>) -> Option<Slot> {
    let name = structure.object(slot)?.name.clone();
    structure.remove(&name)?;
    next.clear_pose(slot);
    gone.insert(name.to_string());
    Some(slot)
}

fn find<'a>(
    structure: &'a Structure,
    next: &Scene,
    at: Entry,
    name: &Arc<str>,
) -> Result<(&'a Instance, Stance), SceneError> {
    let instance = structure.robots.get(name).ok_or_else(|| no_robot(at, name))?;
    let stance = next.stance(name).cloned().ok_or_else(|| no_robot(at, name))?;
    Ok((instance, stance))
}

fn no_robot(at: Entry, name: &Arc<str>) -> SceneError {
    SceneError::NoRobot { at, name: name.clone() }
}
