//! What an SRDF adds to a description: groups, states, and pairs that need no check.

use std::fmt;
use std::sync::Arc;

use crate::description::Joint;

/// The content of an SRDF. Links, joints and groups are positions in the lists of the
/// [`Description`](crate::Description) and of this.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Semantics {
    /// Joints between the robot and the world, in the order of the file; names are unique.
    pub virtual_joints: Vec<VirtualJoint>,
    /// Groups in the order of the file; names are unique.
    pub groups: Vec<Group>,
    /// Named values of the joints of groups, in the order of the file.
    pub states: Vec<GroupState>,
    /// End effectors in the order of the file; names are unique.
    pub end_effectors: Vec<EndEffector>,
    /// Joints without a motor, ascending.
    pub passive_joints: Vec<usize>,
    /// Pairs of links that are not checked, ascending.
    pub disabled_pairs: Vec<DisabledPair>,
    /// Links that are not checked with any other, except in [`enabled_pairs`](Self::enabled_pairs);
    /// ascending.
    pub disabled_links: Vec<usize>,
    /// Pairs of links that are checked although one is among the disabled links: the smaller
    /// position first, ascending.
    pub enabled_pairs: Vec<(usize, usize)>,
    /// What is odd in the file, but does not prevent its use; at most 100.
    pub warnings: Vec<Warning>,
}

impl Semantics {
    /// Whether the file says that two links need no check: they are a disabled pair, or one of them
    /// is a disabled link and they are no enabled pair. Symmetric.
    pub fn is_disabled(&self, link: usize, other: usize) -> bool {
        let pair = (link.min(other), link.max(other));
        let listed = self.disabled_pairs.binary_search_by_key(&pair, |pair| (pair.first, pair.second)).is_ok();
        let of_links = [link, other].iter().any(|link| self.disabled_links.binary_search(link).is_ok());
        listed || of_links && self.enabled_pairs.binary_search(&pair).is_err()
    }

    /// Position of the group of a name.
    pub fn group(&self, name: &str) -> Option<usize> {
        self.groups.iter().position(|group| &*group.name == name)
    }
}

/// A joint between the robot and the world.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualJoint {
    /// Unique among the virtual joints, and no name of a joint.
    pub name: Arc<str>,
    /// The kind of movement.
    pub kind: VirtualJointKind,
    /// Frame of the world that it hangs on.
    pub parent_frame: Arc<str>,
    /// Position of the link that it moves, as a rule the root.
    pub child_link: usize,
    /// Whether it has no motor.
    pub is_passive: bool,
}

/// Kinds of virtual joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VirtualJointKind {
    /// No movement.
    Fixed,
    /// Movement in the plane z = 0: x and y in metres, and the angle about z in radians.
    Planar,
    /// Any rigid motion: translation in metres, unit quaternion x y z w.
    Floating,
}

impl VirtualJointKind {
    /// Number of values that it takes.
    pub fn width(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Planar => 3,
            Self::Floating => 7,
        }
    }
}

/// A named set of joints and links.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Unique in its file.
    pub name: Arc<str>,
    /// Positions of its joints, ascending: those that it names, the parent joints of links that it
    /// names, those of its chains and those of its subgroups.
    pub joints: Vec<usize>,
    /// Positions of its virtual joints, ascending.
    pub virtual_joints: Vec<usize>,
    /// Positions of its links, ascending: those that it names, the children of its joints, those of
    /// its chains with both ends, and those of its subgroups.
    pub links: Vec<usize>,
}

/// Values of joints of a group, with a name.
#[derive(Clone, Debug, PartialEq)]
pub struct GroupState {
    /// Unique among the states of its group.
    pub name: Arc<str>,
    /// Position of the group.
    pub group: usize,
    /// Values of joints, in the order of the file.
    pub values: Vec<JointValues>,
    /// Values of virtual joints, in the order of the file.
    pub virtual_values: Vec<JointValues>,
}

impl GroupState {
    /// The joints with values of their own that the state sets, and these values, in the order of
    /// configurations. Joints that mimic another one and virtual joints have no place in a
    /// configuration and are left out. `joints` are those of the description.
    pub fn own_values<'s>(&'s self, joints: &'s [Joint]) -> Vec<(&'s Joint, &'s [f64])> {
        let mut own: Vec<&JointValues> =
            self.values.iter().filter(|values| joints[values.joint].mimic.is_none()).collect();
        // The joints of a configuration are in the order of the description.
        own.sort_unstable_by_key(|values| values.joint);
        own.into_iter().map(|values| (&joints[values.joint], &values.values[..])).collect()
    }
}

/// Values of a joint.
#[derive(Clone, Debug, PartialEq)]
pub struct JointValues {
    /// Position of the joint or virtual joint.
    pub joint: usize,
    /// As many as it takes: metres, radians, or a quaternion, as its kind says.
    pub values: Vec<f64>,
}

/// A group that works on things, such as a gripper.
#[derive(Clone, Debug, PartialEq)]
pub struct EndEffector {
    /// Unique in its file.
    pub name: Arc<str>,
    /// Position of the group that it is.
    pub group: usize,
    /// Position of the link that it is mounted on.
    pub parent_link: usize,
    /// Position of the group that it is mounted on, if the file says so.
    pub parent_group: Option<usize>,
}

/// Two links that need no check.
#[derive(Clone, Debug, PartialEq)]
pub struct DisabledPair {
    /// The smaller position of the two links.
    pub first: usize,
    /// The larger one.
    pub second: usize,
    /// Why, as the file says: `Adjacent`, `Never`, `Default` and others; may be empty.
    pub reason: Arc<str>,
}

/// What is odd in a file, but does not prevent its use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
    /// The element, such as `robot/group_state[ready]/joint[elbow]`.
    pub path: String,
    /// What is odd, and what was done about it.
    pub message: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}, {}: {}", self.line, self.column, self.path, self.message)
    }
}
