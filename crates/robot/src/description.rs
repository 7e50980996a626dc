//! What a robot is made of, as its description says: links, joints, collision geometry.

use std::sync::Arc;

use nalgebra::{Isometry3, Unit, Vector3};
use serde::{Deserialize, Serialize};

/// Links and joints of a robot: one tree with one root.
#[derive(Clone, Debug, PartialEq)]
pub struct Description {
    /// Name of the robot.
    pub name: Arc<str>,
    /// Links in the order of the file; names are unique.
    pub links: Vec<Link>,
    /// Joints in the order of the file; names are unique.
    pub joints: Vec<Joint>,
}

/// A rigid part of a robot, with a frame. A link without collision geometry is a frame only.
#[derive(Clone, Debug, PartialEq)]
pub struct Link {
    /// Unique in its robot.
    pub name: Arc<str>,
    /// What of it can touch anything.
    pub collisions: Vec<Collision>,
}

/// One piece of collision geometry.
#[derive(Clone, Debug, PartialEq)]
pub struct Collision {
    /// Frame of the geometry to the frame of the link, metres.
    pub origin: Isometry3<f64>,
    /// The piece.
    pub geometry: Geometry,
}

/// A piece of geometry in a frame of its own; lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Geometry {
    /// A box about the origin, by its full sides.
    Box {
        /// Full sides along x, y, z.
        sides_m: Vector3<f64>,
    },
    /// A cylinder about the origin with its axis along z.
    Cylinder {
        /// Radius.
        radius_m: f64,
        /// Full length along z.
        length_m: f64,
    },
    /// A ball about the origin.
    Sphere {
        /// Radius.
        radius_m: f64,
    },
    /// All points near a segment of the z axis about the origin.
    Capsule {
        /// Radius.
        radius_m: f64,
        /// Full length of the segment, without the caps.
        length_m: f64,
    },
    /// A mesh of a file.
    Mesh {
        /// As the description names it: a path, `file://` or `package://`.
        uri: String,
        /// Factors along x, y, z; a negative one mirrors.
        scale: Vector3<f64>,
    },
}

/// How a child link moves against its parent.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Unique in its robot.
    pub name: Arc<str>,
    /// The kind of movement.
    pub kind: JointKind,
    /// Position of the parent in the list of links.
    pub parent: usize,
    /// Position of the child in the list of links.
    pub child: usize,
    /// Frame of the joint at rest to the frame of the parent, metres. The frame of the child is
    /// that of the joint.
    pub origin: Isometry3<f64>,
    /// Axis in the frame of the joint: of rotation, of translation, or normal to the plane.
    pub axis: Unit<Vector3<f64>>,
    /// Range of the value: radians or metres; none where it has no end.
    pub limits: Option<Limits>,
    /// Another joint that this one follows.
    pub mimic: Option<Mimic>,
}

/// Kinds of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointKind {
    /// No movement.
    Fixed,
    /// Rotation about the axis within limits; one value, radians.
    Revolute,
    /// Rotation about the axis without limits; one value, radians.
    Continuous,
    /// Translation along the axis within limits; one value, metres.
    Prismatic,
    /// Translation in the plane normal to the axis, then rotation about it; three values: two in
    /// metres along directions that complete the axis to a right-handed frame, and radians.
    Planar,
    /// Any rigid motion; seven values: translation in metres, unit quaternion x y z w.
    Floating,
}

/// Range of a joint: radians or metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Least value.
    pub lower: f64,
    /// Largest value.
    pub upper: f64,
}

/// A joint follows another: its value is `multiplier * value + offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mimic {
    /// Position of the joint that is followed in the list of joints.
    pub joint: usize,
    /// Factor of its value.
    pub multiplier: f64,
    /// What is added: radians or metres.
    pub offset: f64,
}

impl JointKind {
    /// Number of values that it takes.
    pub fn width(self) -> usize {
        match self {
            Self::Fixed => 0,
            Self::Revolute | Self::Continuous | Self::Prismatic => 1,
            Self::Planar => 3,
            Self::Floating => 7,
        }
    }
}
