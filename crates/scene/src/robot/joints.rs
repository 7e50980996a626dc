//! Values of some or all joints of a robot.

use std::sync::Arc;

use sublevel_robot::{ConfigurationError, Kinematics, counted};

/// Values of joints, by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NamedJointValues {
    /// Joints that are named, each once; none: all joints that follow no other one, in the order
    /// of [`Kinematics::variables`].
    pub joints: Vec<Arc<str>>,
    /// Packed values of these, radians or metres: 1 of revolute, continuous and prismatic joints, 3
    /// of planar ones, 7 of floating ones. With no name and no value nothing is said.
    pub values: Vec<f64>,
}

/// Why values of joints cannot be taken.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JointsError {
    /// A name that is none of a joint with values of its own.
    #[error(
        "robot \"{robot}\" has no joint \"{name}\" with a value of its own (fixed and mimic joints have none); \
         its joints are {known}"
    )]
    NoJoint {
        /// Position of the name.
        index: usize,
        /// The name.
        name: Arc<str>,
        /// Name of the robot.
        robot: Arc<str>,
        /// Names of its joints.
        known: String,
    },
    /// A joint twice.
    #[error("joint \"{name}\" is named twice; name it once")]
    Twice {
        /// Position of the second.
        index: usize,
        /// The joint.
        name: Arc<str>,
    },
    /// Too few or too many values.
    #[error("holds {}; the named joints take {width}", counted(*given, "value", "values"))]
    Width {
        /// How many were given.
        given: usize,
        /// How many they take.
        width: usize,
    },
    /// Values that are not finite or outside their limits.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
}

/// Where the values of joints are in a configuration: of those named, or of all.
///
/// # Errors
/// A name that is none of a joint, or one twice.
pub(crate) fn places(kinematics: &Kinematics, joints: &[Arc<str>]) -> Result<Vec<usize>, JointsError> {
    if joints.is_empty() {
        return Ok((0..kinematics.width()).collect());
    }
    let mut places = Vec::new();
    for (index, name) in joints.iter().enumerate() {
        if joints[..index].contains(name) {
            return Err(JointsError::Twice { index, name: name.clone() });
        }
        let Some(variable) = kinematics.variable(name) else {
            let (robot, known) = (kinematics.name().clone(), names(kinematics));
            return Err(JointsError::NoJoint { index, name: name.clone(), robot, known });
        };
        let variable = &kinematics.variables()[variable];
        places.extend(variable.first..variable.first + variable.kind.width());
    }
    Ok(places)
}

/// A configuration with other values of some joints, within the limits.
///
/// # Errors
/// Joints that are not there, too few or too many values, and values that are not usable.
pub(crate) fn with_values(
    kinematics: &Kinematics,
    mut configuration: Vec<f64>,
    named: &NamedJointValues,
) -> Result<Vec<f64>, JointsError> {
    if !named.joints.is_empty() || !named.values.is_empty() {
        let places = places(kinematics, &named.joints)?;
        if places.len() != named.values.len() {
            return Err(JointsError::Width { given: named.values.len(), width: places.len() });
        }
        for (place, value) in places.into_iter().zip(&named.values) {
            configuration[place] = *value;
        }
    }
    kinematics.check(&configuration)?;
    Ok(configuration)
}

/// The joints with values, as a list for messages.
fn names(kinematics: &Kinematics) -> String {
    const SHOWN: usize = 16;
    let variables = kinematics.variables();
    let shown: Vec<_> = variables.iter().take(SHOWN).map(|variable| format!("\"{}\"", variable.name)).collect();
    match variables.len() {
        0 => "none".into(),
        count if count > SHOWN => format!("{}, and {} more", shown.join(", "), count - SHOWN),
        _ => shown.join(", "),
    }
}
