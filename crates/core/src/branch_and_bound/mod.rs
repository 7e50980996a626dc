//! Brackets of distances between sets that need not be convex, by dividing boxes.
//!
//! Each set is covered by boxes, divided as far as a query needs it (`cover.rs`). In a box about c,
//! Taylor's formula bounds each polynomial of the set from below by a linear one, `g(c + δ) >= v +
//! w·δ - r`, r of the second order: points of the set are in the half-space `w·δ <= 1 - v + r`.
//! What is in a box and in such half-spaces reaches along a direction at most as far as the dual of
//! a linear program says, so pairs of boxes are proven apart by a plane, with an error of the
//! second order of their size. The pair with the lowest bound is divided next (branch and bound;
//! Horst and Tuy, Global Optimization, 1996): lower bounds rise, and upper bounds are distances of
//! points that Newton's method finds and that are proven to be in the sets. It may be stopped at
//! any time; the bracket is true whenever that is.
//!
//! A cover depends on the set alone, so it is kept from query to query ([`BranchAndBound`]).
//! Lengths are metres of the common frame of the poses.

mod active_set;
mod cover;
mod cut;
mod distance;
mod goal;
mod limits;
mod local_search;
mod minimise;
mod placed_set;
mod placing;
mod single;
mod waiting;
mod workspace;

pub use distance::SetDistance;
pub use limits::{DEFAULT_STEPS, Limits};
pub use local_search::{LowPoint, NearPoints, lowest_points, nearest_points};
pub use placed_set::{BoundedSet, Membership, PlacedSet, PlacedSetError};
pub use single::{SetHeight, SetLevelDistance, SetPointDistance};
pub use workspace::BranchAndBound;

#[cfg(test)]
mod tests;
