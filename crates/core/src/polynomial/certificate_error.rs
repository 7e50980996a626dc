//! Why a certificate proves nothing.

/// Why a certificate proves nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CertificateError {
    /// The basis or matrix is malformed.
    #[error("the certificate is malformed: {0}")]
    Malformed(String),
    /// The form has a monomial no product of two basis elements gives.
    #[error("the certificate's basis cannot express the {0}; use a larger basis")]
    BasisTooSmall(String),
    /// The smallest eigenvalue does not exceed the residual.
    #[error(
        "the Gram matrix is not proven positive definite beyond its residual {residual:.3e} \
         (smallest eigenvalue about {smallest_eigenvalue:.3e}); use one farther from singular"
    )]
    NotDefinite {
        /// Bound δ of the correction.
        residual: f64,
        /// Smallest eigenvalue, computed without proof.
        smallest_eigenvalue: f64,
    },
}
