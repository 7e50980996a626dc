//! Polynomials of even degree 2 to 8 in three variables: evaluation, rounding bounds, proofs of
//! sos-convexity and of containment.
//!
//! Pure mathematics in the normalized frame of a body (unit-free coordinates `z`); nothing here
//! depends on metres, poses or bodies.

mod certificate_error;
mod containment;
mod dense;
mod gram;
mod hessian_form;
mod horner;
mod interval;
mod jet;
mod lanes;
mod line_root;
mod minimum_proof;
mod monomial;
mod norm_power;
mod range;
mod ray_intervals;
mod residual;
mod rounding;
mod simd;
mod simd_real;
mod sos_gram;
mod substitution;
mod third_derivative_bound;
mod triangle_bound;
mod trivariate;
mod unrolled;
mod verified_cholesky;

pub use certificate_error::CertificateError;
pub use containment::{ContainmentProof, NotContaining, Substituted};
pub use gram::{HessianGram, HessianMonomial, Margin};
pub use jet::{Jet, NumberJet};
pub use lanes::{Aligned, Lanes, MAX_LANES, MAX_SINGLES, Singles, Vector};
pub use minimum_proof::{PairExponents, PairPolynomial, Point, WeightedSquares};
pub use monomial::{Exponents, degree_of, monomials, position};
pub use norm_power::NormPower;
pub use range::LinearBounds;
pub use ray_intervals::Chords;
pub use rounding::{Growth, gamma};
pub use simd::{Arch, Scalar, Simd, SimdLimit, WithSimd, dispatch, dispatch_lanes, limit_simd, widest};
pub use simd_real::{Constant, Number, Schemes};
pub use sos_gram::SosGram;
pub use substitution::Substitution;
pub use third_derivative_bound::{NEAR_LEVEL, ThirdCeiling};
pub use triangle_bound::Peak;
pub use trivariate::{MAX_DEGREE, Polynomial, PolynomialError};
pub use unrolled::Twice;

#[cfg(test)]
mod tests;
