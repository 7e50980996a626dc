//! The point of a body farthest along a direction, and a proven bracket of how far that is: the
//! support function `h(n) = max n·x` of convex analysis. Every measure that needs it asks here.
//!
//! Shapes have closed forms ([`crate::body::ClosedForm`]); else Newton's method starts from the
//! body's table of support points ([`crate::body::Outline`]) or from a point known before: for
//! surfaces without edges along one direction or several at once (`lanes`), else with an active set
//! ([`crate::measure::solver::edge_newton`]). What it does not find is a convex program
//! (`active_set`), which knows the interior point as well.

mod active_set;
mod bracket;
mod height;
mod lanes;

pub(in crate::measure) use active_set::{SupportPoint, support_of_a, support_of_b};
pub(in crate::measure) use bracket::{Asked, Height};
pub(in crate::measure) use height::height;
pub(in crate::measure) use lanes::{Farthest, Sought};
