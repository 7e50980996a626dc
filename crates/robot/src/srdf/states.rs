//! Named values of the joints of groups.

use std::collections::HashSet;

use super::robot::{Named, Robot, unknown};
use super::warnings::Warnings;
use crate::counted;
use crate::error::DescriptionError;
use crate::semantics::{Group, GroupState, JointValues, VirtualJoint};
use crate::xml::{Element, Vocabulary, quoted};

const STATE: Vocabulary = Vocabulary { read: &["joint"], ignored: &[] };

/// The group that an attribute names.
pub(super) fn group(element: Element<'_, '_>, attribute: &str, groups: &[Group]) -> Result<usize, DescriptionError> {
    let name = element.required_attribute(attribute)?;
    let found = groups.iter().position(|group| &*group.name == name);
    found.ok_or_else(|| unknown(element, attribute, "group"))
}

/// The states of a file.
pub(super) fn read(
    root: Element<'_, '_>,
    robot: &Robot<'_>,
    virtual_joints: &[VirtualJoint],
    groups: &[Group],
    warnings: &mut Warnings,
) -> Result<Vec<GroupState>, DescriptionError> {
    let mut names = HashSet::new();
    let mut states = Vec::new();
    for element in root.named("group_state") {
        STATE.check_children(element)?;
        let name = element.required_name("name")?;
        let group = group(element, "group", groups)?;
        if !names.insert((group, name)) {
            let problem = format!("the group has another state {}", quoted(name));
            return Err(element.attribute_error("name", problem, "give each a name of its own"));
        }
        let mut reader = Reader { robot, virtual_joints, group: &groups[group], warnings, seen: HashSet::new() };
        let mut state = GroupState { name: name.into(), group, values: Vec::new(), virtual_values: Vec::new() };
        for joint in element.named("joint") {
            match reader.values(joint)? {
                None => {}
                Some((Named::Joint(joint), values)) => state.values.push(JointValues { joint, values }),
                Some((Named::Virtual(joint), values)) => state.virtual_values.push(JointValues { joint, values }),
            }
        }
        states.push(state);
    }
    Ok(states)
}

/// Reads the joints of one state.
struct Reader<'r> {
    robot: &'r Robot<'r>,
    virtual_joints: &'r [VirtualJoint],
    group: &'r Group,
    warnings: &'r mut Warnings,
    seen: HashSet<Named>,
}

impl Reader<'_> {
    /// A joint and its values; none of a fixed one.
    fn values(&mut self, element: Element<'_, '_>) -> Result<Option<(Named, Vec<f64>)>, DescriptionError> {
        let named = self.robot.joint(element, self.virtual_joints)?;
        let name = quoted(element.required_attribute("name")?);
        let (is_member, width) = match named {
            Named::Joint(joint) => {
                (self.group.joints.binary_search(&joint).is_ok(), self.robot.description.joints[joint].kind.width())
            }
            Named::Virtual(joint) => {
                (self.group.virtual_joints.binary_search(&joint).is_ok(), self.virtual_joints[joint].kind.width())
            }
        };
        if !is_member {
            let problem = format!("the joint {name} is not in the group {}", quoted(&self.group.name));
            return Err(element.attribute_error("name", problem, "remove it, or add it to the group"));
        }
        if !self.seen.insert(named) {
            let problem = format!("the state has the joint {name} twice");
            return Err(element.attribute_error("name", problem, "remove one of them"));
        }
        let values = element.number_list("value")?;
        if width == 0 {
            self.warnings.add(element, format!("the joint {name} is fixed and takes no value; this one is left out"));
            return Ok(None);
        }
        if values.len() != width {
            let holds = counted(values.len(), "number", "numbers");
            let problem = format!("value holds {holds}, and the joint {name} takes {width}");
            return Err(element.attribute_error("value", problem, "write one number for each value of the joint"));
        }
        self.warn_of_limits(element, named, &values);
        Ok(Some((named, values)))
    }

    fn warn_of_limits(&mut self, element: Element<'_, '_>, named: Named, values: &[f64]) {
        let Named::Joint(joint) = named else { return };
        let joint = &self.robot.description.joints[joint];
        let Some(limits) = joint.limits else { return };
        if let Some(value) = values.iter().find(|value| !(limits.lower..=limits.upper).contains(value)) {
            let (lower, upper) = (limits.lower, limits.upper);
            let message = format!("{value:?} is not within the limits of the joint, {lower:?} to {upper:?}");
            self.warnings.add(element, message);
        }
    }
}
