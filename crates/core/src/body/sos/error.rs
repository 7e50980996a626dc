//! Why numbers do not make an sos-body.

use crate::body::body_error::BodyError;
use crate::polynomial::CertificateError;

/// Why numbers do not make an sos-body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SosBodyError {
    /// Its name or its normalization.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The polynomial is not proven a sum of squares.
    #[error("polynomial: {0}")]
    NotSos(CertificateError),
    /// c or its coordinates are not finite, or c is not positive.
    #[error(
        "relaxation: c is {0:e}; c must be positive, c and its coordinates finite (leave it out for no bound of convexity)"
    )]
    Relaxation(f64),
    /// The relaxed polynomial is not proven sos-convex.
    #[error("relaxation: {0}")]
    NotRelaxed(CertificateError),
    /// Nothing bounds the set along an axis.
    #[error(
        "the set is not proven bounded along axis {axis} of its normalized frame: no multiple of a power of z{axis} is proven below p; \
         use a Gram matrix farther from singular"
    )]
    Unbounded {
        /// Which axis, from 0.
        axis: usize,
    },
    /// No point is proven inside.
    #[error("the set has no proven interior: the polynomial was nowhere found below 1; scale it to reach lower")]
    Empty,
}
