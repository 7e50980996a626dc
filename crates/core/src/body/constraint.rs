//! One polynomial inequality of a body, and what is common to several of them.

use crate::polynomial::{HessianGram, Polynomial};

/// Most constraints a body may have.
pub const MAX_CONSTRAINTS: usize = 16;

/// Smallest depth `1 - min g` of a body, in values of the constraints, which are dimensionless.
///
/// The bounds of evaluation errors are below 1e-12 for bodies of size 1 in the normalized frame: a
/// depth of 1e-9 stays a thousand times above them, so that a ball around the interior point can be
/// proven inside. A larger value refuses thin bodies that can be proven; a smaller one lets bodies
/// pass whose interior is lost in rounding. Pinned by `a_body_needs_a_depth_above_rounding`.
pub(super) const MIN_DEPTH: f64 = 1e-9;

/// One sos-convex constraint `g(z) <= 1` with the certificate that it is sos-convex.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// The polynomial g, in the normalized frame.
    pub polynomial: Polynomial,
    /// Gram matrix of its Hessian form.
    pub gram: HessianGram,
}

/// Largest of the values; NaN if any is NaN, which `f64::max` would pass over.
pub(crate) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, |most, value| if value.is_nan() || value > most { value } else { most })
}
