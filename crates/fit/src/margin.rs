//! Margins of certificates.

/// Default of [`FitOptions::margin`](super::FitOptions::margin).
pub const DEFAULT_MARGIN: f64 = 1e-5;

/// Factors on the margin for further attempts, when the certificate of a fit could not be proven.
pub(super) const MARGIN_ATTEMPTS: [f64; 3] = [1.0, 10.0, 100.0];
