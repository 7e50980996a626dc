//! The structure of the code: which layer may import which, and that no files import each other.

mod circles;
mod directions;
mod source;
mod verifier;
