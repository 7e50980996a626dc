//! Points that a body is proven to contain.

use super::id::hash_points;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Which points a body was proven to contain.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContainedPoints {
    /// Number of points.
    pub count: usize,
    /// SHA-256 of their coordinates in metres as little-endian f64, in input order, as 64
    /// hexadecimal digits.
    pub sha256: String,
}

impl ContainedPoints {
    /// Count and hash of these points.
    pub fn of(points: &[Vector3<f64>]) -> Self {
        Self { count: points.len(), sha256: hash_points(points) }
    }
}

/// A point that is not proven inside.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("point {index} is not proven inside: largest constraint {value} > 1")]
pub struct NotContained {
    /// Position of the point.
    pub index: usize,
    /// Rigorous upper bound of the largest constraint there.
    pub value: f64,
}

/// The largest of values that must be at most 1; of none, the least number.
pub(super) fn all_inside(values: impl Iterator<Item = f64>) -> Result<f64, NotContained> {
    let mut worst = NotContained { index: 0, value: f64::MIN };
    for (index, value) in values.enumerate() {
        // A NaN is never inside.
        if !(value <= worst.value) {
            worst = NotContained { index, value };
            if value.is_nan() {
                break;
            }
        }
    }
    if worst.value <= 1.0 { Ok(worst.value) } else { Err(worst) }
}
