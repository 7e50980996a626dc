//! Sets that need not be convex: `{x : p(x) <= 1}` with p a sum of squares.
//!
//! An [`SosBody`] is a type of its own, so that it cannot be passed where convexity is assumed. It
//! is proven bounded, and to contain the points it was fitted around; what lies between them has to
//! be proven triangle by triangle ([`Coverage`]). Relaxed sets also prove how far they are from
//! convex: `p + c |u|^2d` is sos-convex ([`Relaxation`]).

mod coverage;
mod error;
mod file;
mod method;
mod prove_coverage;
mod relaxation;
mod sos_body;
mod support_bounds;
mod volume;

pub use coverage::{Coverage, TriangleError, Uncovered};
pub use error::SosBodyError;
pub use method::SosMethod;
pub use relaxation::Relaxation;
pub use sos_body::SosBody;

#[cfg(test)]
mod tests;
