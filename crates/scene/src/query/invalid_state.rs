//! Why a state is invalid.

use std::sync::Arc;

use sublevel_core::measure::PoseError;
use sublevel_robot::ConfigurationError;

/// Why a state is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidState {
    /// Joint values that are no configuration.
    #[error(transparent)]
    Joints(#[from] ConfigurationError),
    /// An object would have no pose.
    #[error("object \"{object}\" has no usable pose: {error}")]
    Pose {
        /// Name of the object.
        object: Arc<str>,
        /// Which of the packed poses of all states, from 0, places it or what holds it; none where
        /// joint values do.
        pose: Option<usize>,
        /// The reason.
        error: PoseError,
    },
}

impl InvalidState {
    /// Which of the packed poses of all states, from 0, is the reason; none where joint values are.
    pub fn pose(&self) -> Option<usize> {
        match self {
            Self::Joints(_) => None,
            Self::Pose { pose, .. } => *pose,
        }
    }
}
