//! One body around whole sets: the union of several bodies, or a set that is not convex.
//!
//! [`enclose`] solves the program of section V of Ahmadi, Hall, Makadia and Sindhwani (RSS 2017),
//! sos-convex p with multipliers for every set (`program`); the Gram matrices of these become the
//! [`Containment`] of each set. [`containment`] looks for such a proof when body and set are given
//! both, and [`group`](group()) puts many bodies into few. Every set has a frame of its own for its
//! proof (`region`), with the frames' rounding paid for ([`Containment`]).

mod enclosure;
mod error;
mod group;
mod options;
mod program;
mod prove;
mod region;

pub use enclosure::{Enclosure, enclose, enclose_obstacles};
pub use error::{EncloseError, MAX_SETS};
pub use group::{Cover, Group, group};
pub use options::{EncloseOptions, MAX_MULTIPLIER_DEGREE};
pub use prove::{NoContainment, containment};
pub use region::Region;

#[cfg(test)]
mod tests;
