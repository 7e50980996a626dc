//! Why numbers do not make a body.

use super::constraint::{MAX_CONSTRAINTS, MIN_DEPTH};
use crate::polynomial::CertificateError;

/// Why numbers do not make a body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A name that is empty, too long or has control characters.
    #[error("name {0:?} must have 1 to 200 characters and no control characters")]
    Name(String),
    /// No constraint or too many.
    #[error("a body has 1 to {MAX_CONSTRAINTS} constraints, not {0}; intersect fewer or fit one polynomial")]
    ConstraintCount(usize),
    /// A degree other than 2, 4, 6, 8.
    #[error("degree {0} is not one of 2, 4, 6, 8")]
    Degree(u8),
    /// The normalization is not an invertible affine map.
    #[error("normalization: {0}; it must be finite and invertible, with lengths between 1e-30 and 1e30 m")]
    Normalization(&'static str),
    /// A constraint is not proven sos-convex.
    #[error("constraints[{index}]: {source}")]
    Certificate {
        /// Which constraint.
        index: usize,
        /// What is missing.
        source: CertificateError,
    },
    /// The interior is empty or too shallow.
    #[error(
        "the body has no proven interior: min g = {min_value:e}, which must be at most 1 - {MIN_DEPTH:e}; \
         renormalise g to 1 + (g - 1)/(1 - min g) if the set is meant to have one"
    )]
    Interior {
        /// Smallest value found of the largest constraint.
        min_value: f64,
    },
    /// No ball inside survives rounding.
    #[error(
        "no ball around the interior point is proven inside: the body is too thin, or too far from the origin of its frame \
         for its size; move the frame to the body"
    )]
    Thin,
    /// A growth centre that is not proven to lie well inside.
    #[error(
        "the growth centre {center:?} is not proven inside; take a point farther from the boundary, such as the interior \
         point of the body"
    )]
    GrowthCenter {
        /// The point, metres in the body frame.
        center: [f64; 3],
    },
    /// No proof that the body is bounded.
    #[error(
        "the body is not proven bounded (residual {residual:.1e}); add constraints that close it in every direction"
    )]
    Unbounded {
        /// Largest residual of a support bound along an axis.
        residual: f64,
    },
}

/// Whether a text can name a body, or what it was made from.
///
/// # Errors
/// [`BodyError::Name`].
pub fn check_name(name: &str) -> Result<(), BodyError> {
    if name.is_empty() || name.chars().count() > 200 || name.chars().any(char::is_control) {
        return Err(BodyError::Name(name.chars().take(200).collect()));
    }
    Ok(())
}
