//! The mathematics of Sublevel: polynomials with their proofs, certified convex bodies, and what is
//! measured between them.
//!
//! Nothing here depends on files of meshes, of scenes or of a network; [`body`] reads and writes
//! body files as text. The package `sublevel` re-exports these modules.

pub mod body;
pub mod branch_and_bound;
pub mod measure;
pub mod optimize;
pub mod polynomial;
