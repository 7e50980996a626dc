//! The affine map from the body frame to the normalized frame, in which polynomials are written.

use super::body_error::BodyError;
use nalgebra::{Matrix3, Vector3};

/// The affine map `z = linear (x - center)` from the body frame (x, metres) to the normalized frame
/// (z, unit-free).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalization {
    /// Point of the body frame that z = 0 stands for, metres.
    pub center: Vector3<f64>,
    /// Matrix per metre.
    pub linear: Matrix3<f64>,
}

/// The inverse of the linear part, metres; rounded.
///
/// # Errors
/// [`BodyError::Normalization`] for entries that are not finite or out of range, and for a matrix
/// that is singular up to rounding.
pub(super) fn invert(normalization: &Normalization) -> Result<Matrix3<f64>, BodyError> {
    let Normalization { center, linear } = normalization;
    if !center.iter().chain(linear.iter()).all(|value| value.is_finite()) {
        return Err(BodyError::Normalization("an entry is not finite"));
    }
    if center.amax() > 1e30 || !(1e-30..=1e30).contains(&linear.amax()) {
        return Err(BodyError::Normalization("an entry is out of range"));
    }
    let inverse = linear.try_inverse().ok_or(BodyError::Normalization("linear is singular"))?;
    // Relative to the rows, whose lengths may differ by any factor: the bounds of a placement rest
    // on it.
    let rows = Vector3::from_fn(|i, _| linear.row(i).norm());
    let error = (linear * inverse - Matrix3::identity()).abs() * rows;
    if (0..3).all(|i| error[i] <= 1e-6 * rows[i]) && inverse.amax() <= 1e30 {
        Ok(inverse)
    } else {
        Err(BodyError::Normalization("linear is numerically singular"))
    }
}
