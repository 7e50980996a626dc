//! What tests and benches of several crates share: seeded draws, the bodies and the cases of the
//! stability catalogue as plain data, and references of 200 bits. Not published.

#![allow(missing_docs, unreachable_pub)]

pub mod bodies;
pub mod catalogue;
mod data;
pub mod random;
pub mod reference;
mod solver;
pub mod sos_bodies;

pub use data::data;
pub use random::Seeded;
pub use solver::solver_under_test;
