//! Robots: what URDF and SRDF say of them, where their links are, and motions that are proven to be
//! free.
//!
//! A [`Description`] is what a file says, a [`Kinematics`] its tree of links. Lengths are metres,
//! angles radians; poses map the frame of a part to the frame of what it is part of.

mod counted;
mod description;
mod error;
mod kinematics;
mod mesh_path;
pub mod motion;
mod semantics;
mod srdf;
#[cfg(test)]
mod tests;
mod urdf;
mod xml;

pub use counted::counted;
pub use description::{Collision, Description, Geometry, Joint, JointKind, Limits, Link, Mimic};
pub use error::DescriptionError;
pub use kinematics::{ConfigurationError, Kinematics, KinematicsError, PlaceError, Variable};
pub use mesh_path::{MeshPathError, MeshPaths};
pub use semantics::{
    DisabledPair, EndEffector, Group, GroupState, JointValues, Semantics, VirtualJoint, VirtualJointKind, Warning,
};
pub use srdf::read_srdf;
pub use urdf::read_urdf;
