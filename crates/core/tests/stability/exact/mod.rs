//! Certificates of answers in exact rational arithmetic: no rounding anywhere, hence no tolerance.
//!
//! A bracket is true if points and multipliers exist that prove both its ends, however they were
//! found. The 200-bit reference finds them here; what they prove is computed from the stored
//! coefficients, normalizations and quaternions as rational numbers (square roots by rational
//! bounds that are checked by squaring), and compared with the answer by `<=`.

pub(crate) mod number;
pub(crate) mod proof;
mod solid;

pub(crate) use solid::Solid;
