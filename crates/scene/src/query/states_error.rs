//! Why states cannot be placed.

use std::sync::Arc;

use sublevel_robot::counted;

use crate::robot::JointsError;

/// Why states cannot be placed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StatesError {
    /// No object.
    #[error("is empty; name the objects that the states place")]
    NoObject,
    /// An object twice.
    #[error("object {0} is named twice; name it once")]
    Twice(usize),
    /// Numbers that are not whole states.
    #[error("holds {numbers} numbers, which is no multiple of {per_state}: 7 for each of {objects} objects")]
    Numbers {
        /// How many there are.
        numbers: usize,
        /// How many make a state.
        per_state: usize,
        /// Number of objects.
        objects: usize,
    },
    /// Joint values that are not whole states.
    #[error("holds {numbers} numbers, which is no multiple of {per_state}, what the joints of a state take")]
    JointNumbers {
        /// How many there are.
        numbers: usize,
        /// How many make a state.
        per_state: usize,
    },
    /// No joint values.
    #[error("is empty; send the joint values of at least one state")]
    NoJointState,
    /// Joints that are not there.
    #[error(transparent)]
    Joints(JointsError),
    /// A robot that is not there.
    #[error("no robot \"{0}\" in the scene; place it first")]
    NoRobot(Arc<str>),
    /// A robot that cannot touch anything.
    #[error("robot \"{0}\" has no link with geometry, so nothing is to be checked; load it with bodies for its links")]
    NoGeometry(Arc<str>),
    /// No state.
    #[error("is empty; send at least one state")]
    NoState,
    /// A robot of which no joint has a value.
    #[error("robot \"{0}\" has no joint with a value of its own; ask about its links as objects with poses")]
    NoJoints(Arc<str>),
    /// Several states where one is asked about.
    #[error("holds {0} states; send one")]
    Several(usize),
    /// Joint values that are not one state.
    #[error("holds {}; the joints of one state take {per_state}", counted(*numbers, "number", "numbers"))]
    OneState {
        /// How many there are.
        numbers: usize,
        /// How many make a state.
        per_state: usize,
    },
}
