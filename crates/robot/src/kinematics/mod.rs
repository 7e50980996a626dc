//! Where the links of a robot are for given joint values.
//!
//! A [`Kinematics`] is the tree of links in flat arrays, sorted from the root: joint `i` moves link
//! `i + 1`. A *configuration* is the values of all joints that follow no other one, packed in the
//! order of [`Kinematics::variables`]; radians, metres, and unit quaternions x y z w.

mod configuration;
mod forward;
mod jacobian;
#[cfg(test)]
pub(crate) mod tests;
mod tree;

pub use configuration::ConfigurationError;
pub(crate) use configuration::LIMIT_SLACK;
pub use forward::PlaceError;
pub use tree::{Kinematics, KinematicsError, Variable};
