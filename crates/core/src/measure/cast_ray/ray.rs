//! A ray.

use nalgebra::Vector3;

/// A ray of finite or infinite length in the world frame; checked when made.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::Ray;
///
/// let ray = Ray::new(Vector3::zeros(), Vector3::new(0.0, 3.0, 0.0), 10.0)?;
/// assert_eq!(ray.point(2.0), Vector3::new(0.0, 2.0, 0.0));
/// assert!(Ray::new(Vector3::zeros(), Vector3::zeros(), 10.0).is_err());
/// # Ok::<(), sublevel_core::measure::RayError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    pub(super) origin: Vector3<f64>,
    pub(super) direction: Vector3<f64>,
    pub(super) max_length: f64,
}

/// Why numbers are not a ray.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RayError {
    /// A coordinate is NaN or infinite, or too large.
    #[error("{0} of the ray is not finite, or beyond 1e15 m")]
    NotFinite(&'static str),
    /// A direction without length.
    #[error("the direction of the ray is zero")]
    NoDirection,
    /// A length that is not positive.
    #[error("the ray is {0} m long; give a length above 0, which may be infinite")]
    Length(f64),
    /// A radius of the swept ball that is not positive.
    #[error("the swept ball has radius {0} m; give a radius above 0, or cast a ray")]
    Radius(f64),
}

impl Ray {
    /// The ray from `origin` (m) along `direction` (any length but zero; normalised) over
    /// `max_length` metres, which may be infinite.
    ///
    /// # Errors
    /// Numbers that are not finite, a zero direction, or a length that is not above 0.
    pub fn new(origin: Vector3<f64>, direction: Vector3<f64>, max_length: f64) -> Result<Self, RayError> {
        // Not `>`: a NaN is refused too.
        if !(origin.amax() <= 1e15 && origin.iter().all(|value| value.is_finite())) {
            return Err(RayError::NotFinite("origin"));
        }
        if !direction.iter().all(|value| value.is_finite()) {
            return Err(RayError::NotFinite("direction"));
        }
        let largest = direction.amax();
        if !(largest > 0.0) {
            return Err(RayError::NoDirection);
        }
        if !(max_length > 0.0) {
            return Err(RayError::Length(max_length));
        }
        Ok(Self { origin, direction: (direction / largest).normalize(), max_length })
    }

    /// Start, metres.
    pub fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// Direction, of length 1 up to rounding; parameters along the ray multiply this vector.
    pub fn direction(&self) -> &Vector3<f64> {
        &self.direction
    }

    /// Length, metres.
    pub fn max_length(&self) -> f64 {
        self.max_length
    }

    /// The point at a parameter in metres.
    pub fn point(&self, parameter: f64) -> Vector3<f64> {
        self.origin + self.direction * parameter
    }
}
