//! The truth with 200 bits: Newton's method on the optimality systems, started at an answer's
//! witnesses.
//!
//! Nothing is shared with the solver but the stored numbers: polynomials are evaluated term by term
//! from their coefficients, normalizations are exact, and a pose's quaternion is normalized
//! exactly. What Newton's method finds is not believed either: it is bracketed by weak duality
//! (below) and feasibility (above) in the same 200 bits, usually within 1e-40 of the size, so that
//! "the bracket of the answer contains the truth" is decided and not estimated.

mod active;
pub mod big;
pub mod capsule;
pub mod distance;
pub mod dual;
pub mod growth;
pub mod half_space;
pub mod level;
mod segment;
pub mod signed;
mod solid;

pub use distance::distance;
pub use level::level_distance;
pub use solid::Solid;
