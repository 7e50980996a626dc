//! The tree of links, from the root outwards.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::description::{Description, Joint, JointKind, Limits, Link};

/// Links and joints in flat arrays, parents before children.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// Without collision geometry.
    description: Description,
    /// Link 0 is the root.
    links: Vec<Arc<str>>,
    places: HashMap<Arc<str>, usize>,
    /// Joint `i` moves link `i + 1`.
    pub(crate) joints: Vec<TreeJoint>,
    variables: Vec<Variable>,
    width: usize,
}

/// A joint that follows no other one: what a configuration has values of.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Name of the joint.
    pub name: Arc<str>,
    /// The kind of movement.
    pub kind: JointKind,
    /// Position of its first value in a configuration.
    pub first: usize,
    /// Range of its value: radians or metres; none where it has no end. Only of joints of one
    /// value.
    pub limits: Option<Limits>,
}

/// A joint where it stands in the tree.
#[derive(Clone, Debug)]
pub(crate) struct TreeJoint {
    #[cfg(test)]
    pub(crate) name: Arc<str>,
    pub(crate) kind: JointKind,
    /// The link that it is fixed to.
    pub(crate) parent: usize,
    /// Frame of the joint at rest to the frame of the parent.
    pub(crate) rotation: UnitQuaternion<f64>,
    pub(crate) translation: Vector3<f64>,
    /// Unit vector in the frame of the joint.
    pub(crate) axis: Vector3<f64>,
    /// Two unit vectors that complete the axis to a right-handed frame: `first x second = axis`.
    pub(crate) across: [Vector3<f64>; 2],
    /// Product of `rotation` with the half turn about the axis.
    pub(crate) half_turn: Quaternion<f64>,
    /// Where its value is in a configuration; nothing of fixed joints.
    pub(crate) first: usize,
    /// `value = multiplier * configuration[first] + offset`, of joints that follow another.
    pub(crate) mimic: Option<(f64, f64)>,
}

/// Why links and joints are no tree.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KinematicsError {
    /// No link.
    #[error("robot {0} has no links")]
    NoLink(Arc<str>),
    /// A joint names a link or a joint that is not there.
    #[error("joint {0} names a link or joint that is not in the lists")]
    Position(Arc<str>),
    /// A link has two parents.
    #[error("link {0} is the child of two joints; a link has one parent")]
    TwoParents(Arc<str>),
    /// A link hangs on no root.
    #[error("link {link} is not connected to the root {root}")]
    NotConnected {
        /// The root.
        root: Arc<str>,
        /// A link that cannot be reached from it.
        link: Arc<str>,
    },
    /// All links are children: the joints form a cycle.
    #[error("every link of robot {0} is the child of a joint: the joints form a cycle")]
    NoRoot(Arc<str>),
    /// A mimic that cannot be followed.
    #[error("joint {0} mimics a joint that has no value of its own, or not exactly one")]
    Mimic(Arc<str>),
}

impl Kinematics {
    /// The tree of a description.
    ///
    /// # Errors
    /// Links and joints that are not one tree; none of a description that
    /// a reader has checked.
    pub fn new(description: &Description) -> Result<Self, KinematicsError> {
        let (links, joints) = (&description.links, &description.joints);
        let mut children = vec![Vec::new(); links.len()];
        let mut has_parent = vec![false; links.len()];
        for (index, joint) in joints.iter().enumerate() {
            let is_there = joint.parent < links.len() && joint.child < links.len();
            if !is_there || joint.mimic.is_some_and(|mimic| mimic.joint >= joints.len()) {
                return Err(KinematicsError::Position(joint.name.clone()));
            }
            if std::mem::replace(&mut has_parent[joint.child], true) {
                return Err(KinematicsError::TwoParents(links[joint.child].name.clone()));
            }
            children[joint.parent].push(index);
        }
        let mut roots = (0..links.len()).filter(|&link| !has_parent[link]);
        let Some(root) = roots.next() else {
            let name = description.name.clone();
            return Err(if links.is_empty() { KinematicsError::NoLink(name) } else { KinematicsError::NoRoot(name) });
        };
        let mut tree = Self {
            description: Description { links: links.iter().map(frame).collect(), ..description.clone() },
            links: vec![links[root].name.clone()],
            places: HashMap::new(),
            joints: Vec::with_capacity(joints.len()),
            variables: Vec::new(),
            width: 0,
        };
        let firsts = tree.take_variables(joints)?;
        // Depth first, in the order of the file: a branch stays together.
        let mut open: Vec<(usize, usize)> = children[root].iter().rev().map(|&joint| (joint, 0)).collect();
        while let Some((index, parent)) = open.pop() {
            let joint = &joints[index];
            tree.joints.push(TreeJoint::new(joint, parent, firsts[index]));
            tree.links.push(links[joint.child].name.clone());
            let child = tree.links.len() - 1;
            open.extend(children[joint.child].iter().rev().map(|&joint| (joint, child)));
        }
        tree.places = tree.links.iter().cloned().enumerate().map(|(place, name)| (name, place)).collect();
        match links.iter().find(|link| !tree.places.contains_key(&link.name)) {
            Some(link) if tree.links.len() < links.len() => {
                Err(KinematicsError::NotConnected { root: links[root].name.clone(), link: link.name.clone() })
            }
            _ => Ok(tree),
        }
    }

    /// Gives every joint that follows no other one its place in a configuration; returns the place
    /// for all joints.
    fn take_variables(&mut self, joints: &[Joint]) -> Result<Vec<usize>, KinematicsError> {
        let mut firsts = vec![0; joints.len()];
        for (joint, first) in joints.iter().zip(&mut firsts) {
            if joint.mimic.is_none() && joint.kind.width() > 0 {
                *first = self.width;
                let limits = joint.limits.filter(|_| joint.kind.width() == 1 && joint.kind != JointKind::Continuous);
                let (name, kind) = (joint.name.clone(), joint.kind);
                self.variables.push(Variable { name, kind, first: *first, limits });
                self.width += joint.kind.width();
            }
        }
        for (index, joint) in joints.iter().enumerate() {
            if let Some(mimic) = joint.mimic {
                let followed = &joints[mimic.joint];
                if followed.mimic.is_some() || followed.kind.width() != 1 || joint.kind.width() != 1 {
                    return Err(KinematicsError::Mimic(joint.name.clone()));
                }
                firsts[index] = firsts[mimic.joint];
            }
        }
        Ok(firsts)
    }

    /// Name of the robot.
    pub fn name(&self) -> &Arc<str> {
        &self.description.name
    }

    /// Links, without collision geometry, and joints as they were described.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// Names of the links: the root first, parents before children.
    pub fn links(&self) -> &[Arc<str>] {
        &self.links
    }

    /// Position of a link in [`Kinematics::links`].
    pub fn link(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Joints that follow no other one, in the order of a configuration.
    pub fn variables(&self) -> &[Variable] {
        &self.variables
    }

    /// Number of values of a configuration.
    pub fn width(&self) -> usize {
        self.width
    }

    /// No origin of a link is farther from that of the root than this within the joint limits,
    /// metres; infinite with joints that slide without limits, or move in a plane or freely.
    pub fn reach_m(&self) -> f64 {
        let travel = |joint: &TreeJoint| match joint.kind {
            JointKind::Fixed | JointKind::Revolute | JointKind::Continuous => 0.0,
            JointKind::Planar | JointKind::Floating => f64::INFINITY,
            JointKind::Prismatic => {
                let followed = self.variables.iter().find(|variable| variable.first == joint.first);
                let farthest = followed.and_then(|variable| variable.limits);
                let farthest = farthest.map_or(f64::INFINITY, |limits| limits.lower.abs().max(limits.upper.abs()));
                // A multiplier of 0 keeps it at its offset; 0 times infinity would be NaN.
                let follows = |multiplier: f64| if multiplier == 0.0 { 0.0 } else { multiplier.abs() * farthest };
                joint.mimic.map_or(farthest, |(multiplier, offset)| follows(multiplier) + offset.abs())
            }
        };
        self.joints.iter().map(|joint| joint.translation.norm() + travel(joint)).sum()
    }

    /// The link that a link hangs on; none of the root.
    pub fn parent(&self, link: usize) -> Option<usize> {
        Some(self.joints.get(link.checked_sub(1)?)?.parent)
    }

    /// Whether a link is fixed to the link that it hangs on.
    pub fn is_fixed(&self, link: usize) -> bool {
        let joint = link.checked_sub(1).and_then(|joint| self.joints.get(joint));
        joint.is_some_and(|joint| joint.kind == JointKind::Fixed)
    }
}

/// A link without its collision geometry.
fn frame(link: &Link) -> Link {
    Link { name: link.name.clone(), collisions: Vec::new() }
}

impl TreeJoint {
    fn new(joint: &Joint, parent: usize, first: usize) -> Self {
        let axis = joint.axis.into_inner();
        let rotation = joint.origin.rotation;
        let helper = if axis.z.abs() > 0.9 { Vector3::x() } else { Vector3::z() };
        let one = (helper - axis * axis.dot(&helper)).normalize();
        let half_turn = rotation.into_inner() * Quaternion::from_imag(axis);
        let mimic = joint.mimic.map(|mimic| (mimic.multiplier, mimic.offset));
        let (kind, translation) = (joint.kind, joint.origin.translation.vector);
        Self {
            #[cfg(test)]
            name: joint.name.clone(),
            kind,
            parent,
            rotation,
            translation,
            axis,
            across: [one, axis.cross(&one)],
            half_turn,
            first,
            mimic,
        }
    }

    /// The value of a joint that has one.
    pub(crate) fn value(&self, configuration: &[f64]) -> f64 {
        let value = configuration[self.first];
        self.mimic.map_or(value, |(multiplier, offset)| multiplier * value + offset)
    }

    /// Derivative of [`TreeJoint::value`] with respect to the value in the configuration.
    pub(crate) fn rate(&self) -> f64 {
        self.mimic.map_or(1.0, |(multiplier, _)| multiplier)
    }
}
