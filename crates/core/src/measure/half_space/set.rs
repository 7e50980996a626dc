//! Half-spaces as their normal and offset.

use nalgebra::Vector3;

/// Deviation of a normal from length 1, dimensionless, up to which it counts as normalised: five
/// roundings, each of 2^-53, make its length and this measure of it.
///
/// A smaller value would normalise again what is read from a file and change its last bits, and
/// with them its id; a larger one keeps normals whose length falsifies distances. Pinned by
/// `normals_settle` of scenes.
const NORMALISED_NORMAL: f64 = 3.0 * f64::EPSILON;

/// The half-space `{x : normal·x <= offset}` of the world frame; checked when made.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::HalfSpace;
///
/// let floor = HalfSpace::new(Vector3::z(), 0.0)?;
/// assert!(HalfSpace::new(Vector3::new(0.0, 0.0, 2.0), 0.0).is_err());
/// # Ok::<(), sublevel_core::measure::HalfSpaceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    normal: Vector3<f64>,
    offset: f64,
}

/// Why numbers are not a half-space.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HalfSpaceError {
    /// A number is NaN, infinite or too large.
    #[error("{0} of the half-space is not finite, or beyond 1e15 m")]
    NotFinite(&'static str),
    /// A normal that is not of length one.
    #[error(
        "the normal is not a unit vector: its length deviates by {0:.3e}, at most 1e-6 is accepted; normalise it and \
         scale the offset along"
    )]
    NotUnit(f64),
}

impl HalfSpace {
    /// The points x with `normal·x <= offset` (m), for an outward normal within 1e-6 of length 1,
    /// which is normalised; the normal of a half-space makes the same half-space again, bit for
    /// bit.
    ///
    /// # Errors
    /// Numbers that are not finite, or a normal that is farther from length 1.
    pub fn new(normal: Vector3<f64>, offset: f64) -> Result<Self, HalfSpaceError> {
        if !normal.iter().all(|value| value.is_finite()) {
            return Err(HalfSpaceError::NotFinite("normal"));
        }
        // Not `>`: a NaN is refused too.
        if !(offset.abs() <= 1e15) {
            return Err(HalfSpaceError::NotFinite("offset"));
        }
        let deviation = (normal.norm() - 1.0).abs();
        if deviation > 1e-6 {
            return Err(HalfSpaceError::NotUnit(deviation));
        }
        let normal = if deviation <= NORMALISED_NORMAL { normal } else { normal.normalize() };
        Ok(Self { normal, offset })
    }

    /// Outward unit normal.
    pub fn normal(&self) -> &Vector3<f64> {
        &self.normal
    }

    /// Largest `normal·x`, metres.
    pub fn offset(&self) -> f64 {
        self.offset
    }
}
