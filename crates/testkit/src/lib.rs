//! What tests and benches of several crates share: seeded draws, the bodies and the cases of the
//! stability catalogue as plain data, references of 200 bits, and intersections of triangles. Not
//! published.

#![allow(missing_docs, unreachable_pub)]

pub mod bodies;
pub mod catalogue;
mod data;
pub mod random;
pub mod reference;
mod solver;
pub mod sos_bodies;
pub mod triangles;

pub use data::data;
pub use random::Seeded;
pub use solver::solver_under_test;
