//! Joints between the robot and the world, and joints without motors.

use std::collections::{BTreeSet, HashSet};

use super::robot::{Named, Robot};
use super::warnings::Warnings;
use crate::error::DescriptionError;
use crate::semantics::{VirtualJoint, VirtualJointKind};
use crate::xml::{Element, check_unique, quoted};

/// Most virtual joints.
const MOST: usize = 100;

/// The virtual joints of a file.
pub(super) fn read(
    root: Element<'_, '_>,
    robot: &Robot<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<VirtualJoint>, DescriptionError> {
    if let Some(element) = root.named("virtual_joint").nth(MOST) {
        return Err(element.error(format!("the file has more than {MOST} virtual joints"), "remove some"));
    }
    let mut names = HashSet::new();
    let mut joints = Vec::new();
    for element in root.named("virtual_joint") {
        let name = element.required_name("name")?;
        check_unique(&mut names, element, name)?;
        if robot.has_joint(name) {
            let problem = format!("the URDF has a joint {}, too", quoted(name));
            return Err(element.attribute_error("name", problem, "give the virtual joint another name"));
        }
        let child_link = robot.link(element, "child_link")?;
        if robot.parent_joint(child_link).is_some() {
            let message = "its child link is not the root of the robot, so that it moves nothing".to_string();
            warnings.add(element, message);
        }
        let parent_frame = element.required_name("parent_frame")?.into();
        joints.push(VirtualJoint {
            name: name.into(),
            kind: kind(element)?,
            parent_frame,
            child_link,
            is_passive: false,
        });
    }
    Ok(joints)
}

fn kind(element: Element<'_, '_>) -> Result<VirtualJointKind, DescriptionError> {
    match element.required_attribute("type")? {
        "fixed" => Ok(VirtualJointKind::Fixed),
        "planar" => Ok(VirtualJointKind::Planar),
        "floating" => Ok(VirtualJointKind::Floating),
        other => {
            let problem = format!("type is {}, which is not a kind of virtual joint", quoted(other));
            Err(element.attribute_error("type", problem, "write fixed, planar or floating"))
        }
    }
}

/// Marks virtual joints as passive, and lists the joints that are; those in groups count, too.
pub(super) fn passive(
    root: Element<'_, '_>,
    robot: &Robot<'_>,
    virtual_joints: &mut [VirtualJoint],
) -> Result<Vec<usize>, DescriptionError> {
    let in_groups = root.named("group").flat_map(|group| group.named("passive_joint"));
    let mut joints = BTreeSet::new();
    for element in root.named("passive_joint").chain(in_groups) {
        match robot.joint(element, virtual_joints)? {
            Named::Joint(joint) => {
                joints.insert(joint);
            }
            Named::Virtual(joint) => virtual_joints[joint].is_passive = true,
        }
    }
    Ok(joints.into_iter().collect())
}
