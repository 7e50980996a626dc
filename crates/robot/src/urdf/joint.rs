//! Joints: kinds, what they connect, axes and limits.

use std::collections::{HashMap, HashSet};

use nalgebra::{Unit, Vector3};

use super::origin::origin;
use crate::description::{Joint, JointKind, Limits, Link};
use crate::error::DescriptionError;
use crate::xml::{Element, Vocabulary, check_unique, quoted};

const JOINT: Vocabulary = Vocabulary {
    read: &["origin", "parent", "child", "axis", "limit", "mimic"],
    ignored: &["dynamics", "safety_controller", "calibration", "hardwareInterface", "gazebo", "sensor"],
};

const LIMIT: Vocabulary =
    Vocabulary { read: &["lower", "upper"], ignored: &["effort", "velocity", "acceleration", "deceleration", "jerk"] };

const AXIS: Vocabulary = Vocabulary { read: &["xyz"], ignored: &["rpy"] };

/// The joints of a robot, in the order of the file, without what they follow.
pub(super) fn joints(elements: &[Element<'_, '_>], links: &[Link]) -> Result<Vec<Joint>, DescriptionError> {
    let positions: HashMap<&str, usize> = links.iter().enumerate().map(|(index, link)| (&*link.name, index)).collect();
    let mut names = HashSet::new();
    let mut joints = Vec::with_capacity(elements.len());
    for element in elements {
        joints.push(joint(*element, &positions)?);
        check_unique(&mut names, *element, element.required_name("name")?)?;
    }
    Ok(joints)
}

fn joint(element: Element<'_, '_>, links: &HashMap<&str, usize>) -> Result<Joint, DescriptionError> {
    let name = element.required_name("name")?;
    JOINT.check_children(element)?;
    let kind = kind(element)?;
    Ok(Joint {
        name: name.into(),
        kind,
        parent: link(element, "parent", links)?,
        child: link(element, "child", links)?,
        origin: origin(element)?,
        axis: axis(element, kind)?,
        limits: limits(element, kind)?,
        mimic: None,
    })
}

fn kind(element: Element<'_, '_>) -> Result<JointKind, DescriptionError> {
    match element.required_attribute("type")? {
        "fixed" => Ok(JointKind::Fixed),
        "revolute" => Ok(JointKind::Revolute),
        "continuous" => Ok(JointKind::Continuous),
        "prismatic" => Ok(JointKind::Prismatic),
        "planar" => Ok(JointKind::Planar),
        "floating" => Ok(JointKind::Floating),
        other => {
            let problem = format!("type is {}, which is not a kind of joint", quoted(other));
            let remedy = "write fixed, revolute, continuous, prismatic, planar or floating";
            Err(element.attribute_error("type", problem, remedy))
        }
    }
}

/// Position of the link that a `<parent>` or `<child>` names.
fn link(element: Element<'_, '_>, side: &'static str, links: &HashMap<&str, usize>) -> Result<usize, DescriptionError> {
    let end = element.required(side, &format!("write <{side} link=\"...\"/>"))?;
    let name = end.required_attribute("link")?;
    links.get(name).copied().ok_or_else(|| {
        let problem = format!("link is {}, and the robot has no link of this name", quoted(name));
        end.attribute_error("link", problem, "correct the name, or add the link")
    })
}

/// The axis; x if there is none, or if the kind has none.
fn axis(element: Element<'_, '_>, kind: JointKind) -> Result<Unit<Vector3<f64>>, DescriptionError> {
    let none = Vector3::x_axis();
    let found = element.optional("axis")?;
    let Some(axis) = found.filter(|_| !matches!(kind, JointKind::Fixed | JointKind::Floating)) else {
        return Ok(none);
    };
    AXIS.check_attributes(axis)?;
    let Some(xyz) = axis.numbers("xyz")? else { return Ok(none) };
    let direction = Vector3::from(xyz);
    let largest = direction.amax();
    if largest == 0.0 {
        return Err(axis.attribute_error("xyz", "the axis has length 0", "write a direction, such as 0 0 1"));
    }
    // Squares neither overflow nor vanish after that.
    Ok(Unit::new_normalize(direction / largest))
}

/// The limits of kinds that have some.
fn limits(element: Element<'_, '_>, kind: JointKind) -> Result<Option<Limits>, DescriptionError> {
    let limit = element.optional("limit")?;
    if !matches!(kind, JointKind::Revolute | JointKind::Prismatic) {
        return Ok(None);
    }
    let Some(limit) = limit else {
        let (shown, unit) = if kind == JointKind::Revolute { ("revolute", "radians") } else { ("prismatic", "metres") };
        let mut remedy = format!("write <limit lower=\"...\" upper=\"...\"/> in {unit}");
        if kind == JointKind::Revolute {
            remedy.push_str(", or make it continuous");
        }
        return Err(element.error(format!("the joint is {shown} and has no <limit>"), remedy));
    };
    LIMIT.check_attributes(limit)?;
    let lower = limit.number("lower")?.unwrap_or(0.0);
    let upper = limit.number("upper")?.unwrap_or(0.0);
    if lower > upper {
        let problem = format!("lower is {lower:?} and above upper, {upper:?}");
        return Err(limit.error(problem, "swap them; one that is missing is 0"));
    }
    Ok(Some(Limits { lower, upper }))
}
