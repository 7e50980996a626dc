//! Values of joints: how many there are, which are usable, and what stands for those not named.

use std::sync::Arc;

use super::Kinematics;
use crate::counted;
use crate::description::JointKind;

/// How far a quaternion may be from unit length; poses take no more either.
const UNIT: f64 = 1e-6;

/// How far a value may be beyond a limit, relative to the larger of 1 and the limit: what printing
/// with 9 digits and reading again costs.
pub(crate) const LIMIT_SLACK: f64 = 1e-9;

/// Why values are no configuration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigurationError {
    /// The wrong number of values.
    #[error("holds {}; this robot takes {width}", counted(*given, "value", "values"))]
    Width {
        /// How many were given.
        given: usize,
        /// How many it takes.
        width: usize,
    },
    /// A value that is not finite.
    #[error("joint {joint} is {value}; give a finite number")]
    NotFinite {
        /// Name of the joint.
        joint: Arc<str>,
        /// The value.
        value: f64,
    },
    /// A value beyond the limits.
    #[error("joint {joint} is {value}, outside its limits {lower} to {upper}; give a value within them")]
    Limits {
        /// Name of the joint.
        joint: Arc<str>,
        /// The value: radians or metres.
        value: f64,
        /// Least value allowed.
        lower: f64,
        /// Largest value allowed.
        upper: f64,
    },
    /// A quaternion that is not of length 1.
    #[error("joint {joint} has a quaternion of length {length}; normalise it")]
    NotUnit {
        /// Name of the joint.
        joint: Arc<str>,
        /// Its length.
        length: f64,
    },
    /// A joint that is not there, or that follows another one.
    #[error("joint {0} is no variable joint of this robot")]
    NoJoint(Arc<str>),
}

impl Kinematics {
    /// The configuration of all zeros, or the limit that is nearest to zero; floating joints do not
    /// turn.
    pub fn default_configuration(&self) -> Vec<f64> {
        let mut values = vec![0.0; self.width()];
        for variable in self.variables() {
            match (variable.kind, variable.limits) {
                (JointKind::Floating, _) => values[variable.first + 6] = 1.0,
                (_, Some(limits)) => values[variable.first] = 0.0_f64.max(limits.lower).min(limits.upper),
                _ => {}
            }
        }
        values
    }

    /// Position of a joint of [`Kinematics::variables`] by its name.
    pub fn variable(&self, name: &str) -> Option<usize> {
        self.variables().iter().position(|variable| &*variable.name == name)
    }

    /// Checks that values are a configuration within the limits of the joints that have values.
    ///
    /// Limits of joints that follow another one do not count: a URDF has to write a `<limit>` for
    /// them, too, in which what is missing is 0, so that many robots would have no configuration at
    /// all. The values of a follower are bounded by the limits of the joint that it follows, as in
    /// other readers of URDF.
    ///
    /// # Errors
    /// The first joint, in order, with a value that is not finite, outside its limits by more than
    /// rounding, or a quaternion not of unit length within 1e-6.
    pub fn check(&self, values: &[f64]) -> Result<(), ConfigurationError> {
        if values.len() != self.width() {
            return Err(ConfigurationError::Width { given: values.len(), width: self.width() });
        }
        for variable in self.variables() {
            let own = &values[variable.first..variable.first + variable.kind.width()];
            let joint = || variable.name.clone();
            if let Some(&value) = own.iter().find(|value| !value.is_finite()) {
                return Err(ConfigurationError::NotFinite { joint: joint(), value });
            }
            if let (Some(limits), &[value]) = (variable.limits, own) {
                let slack = |limit: f64| LIMIT_SLACK * limit.abs().max(1.0);
                if value < limits.lower - slack(limits.lower) || value > limits.upper + slack(limits.upper) {
                    let (lower, upper) = (limits.lower, limits.upper);
                    return Err(ConfigurationError::Limits { joint: joint(), value, lower, upper });
                }
            }
            if let &[_, _, _, x, y, z, w] = own {
                let length = (x * x + y * y + z * z + w * w).sqrt();
                if !((length - 1.0).abs() <= UNIT) {
                    return Err(ConfigurationError::NotUnit { joint: joint(), length });
                }
            }
        }
        Ok(())
    }
}
