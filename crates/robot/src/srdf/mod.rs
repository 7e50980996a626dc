//! SRDF: groups, states and pairs that need no check, of a robot that a URDF describes.

mod end_effectors;
mod groups;
mod pairs;
mod robot;
mod states;
mod virtual_joints;
mod warnings;

use crate::description::Description;
use crate::error::DescriptionError;
use crate::semantics::Semantics;
use crate::xml::{self, Element, Vocabulary, quoted};
use robot::Robot;
use warnings::Warnings;

const ROBOT: Vocabulary = Vocabulary {
    read: &[
        "virtual_joint",
        "group",
        "group_state",
        "end_effector",
        "passive_joint",
        "disable_collisions",
        "disable_default_collisions",
        "enable_collisions",
    ],
    ignored: &["joint_property", "link_sphere_approximation"],
};

/// Reads an SRDF of a robot.
///
/// A chain of a group runs through the tree from its base link to its tip, with both links and
/// without the parent joint of the base link. A link that a group names brings its parent joint.
///
/// # Errors
/// The first thing that is wrong: its line, column and element, and the remedy. Names of links,
/// joints and groups that do not exist are errors.
pub fn read_srdf(text: &str, description: &Description) -> Result<Semantics, DescriptionError> {
    let document = xml::parse(text)?;
    let root = xml::robot(&document)?;
    ROBOT.check_children(root)?;
    check_name(root, description)?;
    let mut warnings = Warnings::default();
    for element in root.children().filter(|element| !ROBOT.has(element.name())) {
        warnings.add(element, format!("the element {} is not read", quoted(element.name())));
    }
    let robot = Robot::new(description);
    let mut virtual_joints = virtual_joints::read(root, &robot, &mut warnings)?;
    let groups = groups::read(root, &robot, &virtual_joints, &mut warnings)?;
    let states = states::read(root, &robot, &virtual_joints, &groups, &mut warnings)?;
    let end_effectors = end_effectors::read(root, &robot, &groups)?;
    let passive_joints = virtual_joints::passive(root, &robot, &mut virtual_joints)?;
    let pairs = pairs::read(root, &robot, &mut warnings)?;
    Ok(Semantics {
        virtual_joints,
        groups,
        states,
        end_effectors,
        passive_joints,
        disabled_pairs: pairs.disabled,
        disabled_links: pairs.disabled_links,
        enabled_pairs: pairs.enabled,
        warnings: warnings.into_list(),
    })
}

fn check_name(root: Element<'_, '_>, description: &Description) -> Result<(), DescriptionError> {
    let name = root.required_name("name")?;
    if *name == *description.name {
        return Ok(());
    }
    let (found, expected) = (quoted(name), quoted(&description.name));
    let problem = format!("name is {found}, and that of the robot in the URDF is {expected}");
    Err(root.attribute_error("name", problem, format!("write name={expected}, or give the SRDF of this robot")))
}
