//! The robot that an SRDF is about: names, and ways through its tree.

use std::collections::HashMap;

use crate::description::Description;
use crate::error::DescriptionError;
use crate::semantics::VirtualJoint;
use crate::xml::{Element, quoted};

/// A description and where its names are.
pub(super) struct Robot<'d> {
    pub(super) description: &'d Description,
    links: HashMap<&'d str, usize>,
    joints: HashMap<&'d str, usize>,
    /// The joint above each link.
    parents: Vec<Option<usize>>,
}

/// A joint of the URDF or of the SRDF.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Named {
    Joint(usize),
    Virtual(usize),
}

impl<'d> Robot<'d> {
    pub(super) fn new(description: &'d Description) -> Self {
        let links = description.links.iter().enumerate().map(|(index, link)| (&*link.name, index)).collect();
        let joints = description.joints.iter().enumerate().map(|(index, joint)| (&*joint.name, index)).collect();
        let mut parents = vec![None; description.links.len()];
        for (index, joint) in description.joints.iter().enumerate() {
            if let Some(parent) = parents.get_mut(joint.child) {
                *parent = Some(index);
            }
        }
        Self { description, links, joints, parents }
    }

    /// The link that an attribute names.
    pub(super) fn link(&self, element: Element<'_, '_>, attribute: &str) -> Result<usize, DescriptionError> {
        let name = element.required_attribute(attribute)?;
        self.links.get(name).copied().ok_or_else(|| unknown(element, attribute, "link"))
    }

    /// The joint or virtual joint that an attribute `name` names.
    pub(super) fn joint(
        &self,
        element: Element<'_, '_>,
        virtual_joints: &[VirtualJoint],
    ) -> Result<Named, DescriptionError> {
        let name = element.required_attribute("name")?;
        let joint = self.joints.get(name).copied().map(Named::Joint);
        let named = || virtual_joints.iter().position(|joint| &*joint.name == name).map(Named::Virtual);
        joint.or_else(named).ok_or_else(|| unknown(element, "name", "joint"))
    }

    /// Whether the URDF has a joint of a name.
    pub(super) fn has_joint(&self, name: &str) -> bool {
        self.joints.contains_key(name)
    }

    /// The joint above a link; none of the root.
    pub(super) fn parent_joint(&self, link: usize) -> Option<usize> {
        self.parents.get(link).copied().flatten()
    }

    /// Joints and links from a link up to the root: each joint is that above the link before it.
    pub(super) fn to_root(&self, link: usize) -> (Vec<usize>, Vec<usize>) {
        let (mut joints, mut links) = (Vec::new(), vec![link]);
        let mut at = link;
        // A tree has fewer steps than links.
        while let Some(joint) = self.parent_joint(at).filter(|_| joints.len() < self.parents.len()) {
            at = self.description.joints[joint].parent;
            joints.push(joint);
            links.push(at);
        }
        (joints, links)
    }
}

/// An attribute names what does not exist.
pub(super) fn unknown(element: Element<'_, '_>, attribute: &str, what: &str) -> DescriptionError {
    let name = quoted(element.attribute(attribute).unwrap_or_default());
    let problem = format!("{attribute} is {name}, and the robot has no {what} of this name");
    element.attribute_error(attribute, problem, format!("correct the name, or remove the <{}>", element.name()))
}
