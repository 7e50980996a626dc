//! URDF: links with their collision geometry, and joints.

mod geometry;
mod joint;
mod link;
mod mimic;
mod origin;
mod tree;

use crate::description::Description;
use crate::error::DescriptionError;
use crate::xml::{self, Element, Vocabulary};

const ROBOT: Vocabulary = Vocabulary {
    read: &["link", "joint"],
    ignored: &["material", "transmission", "gazebo", "ros2_control", "sensor", "actuator", "plugin", "contact"],
};

/// Elements that xacro had before it had a namespace.
const OLD_XACRO: [&str; 6] = ["include", "macro", "property", "insert_block", "if", "unless"];

/// Reads a URDF: links, their collision geometry and joints. What is for show, for simulation and
/// for drivers is passed over.
///
/// Lengths are metres and angles radians, as in the file. Angles `rpy` turn about the fixed axes x,
/// y, z in this order. Axes are normalised. Continuous, fixed, planar and floating joints have no
/// limits, whatever the file says; a fixed joint follows no other.
///
/// # Errors
/// The first thing that is wrong: its line, column and element, and the remedy.
pub fn read_urdf(text: &str) -> Result<Description, DescriptionError> {
    let document = xml::parse(text)?;
    let robot = xml::robot(&document)?;
    check_robot(robot)?;
    let name = robot.required_name("name")?;
    let links = link::links(robot)?;
    let elements: Vec<_> = robot.named("joint").collect();
    let mut joints = joint::joints(&elements, &links)?;
    // A tree has fewer joints than links: what comes after is small.
    tree::check(robot, &links, &joints, &elements)?;
    mimic::resolve(&mut joints, &elements)?;
    Ok(Description { name: name.into(), links, joints })
}

fn check_robot(robot: Element<'_, '_>) -> Result<(), DescriptionError> {
    if let Some(element) = robot.children().find(|element| OLD_XACRO.contains(&element.name())) {
        let problem = format!("the element \"{}\" belongs to xacro", element.name());
        return Err(element.error(problem, "run xacro first: xacro file.xacro > file.urdf"));
    }
    ROBOT.check_children(robot)
}
