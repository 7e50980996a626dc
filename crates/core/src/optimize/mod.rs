//! Solvers for the tiny convex programs of this service: a globally convergent one for up to six
//! variables and up to 32 rows, and the nearest point of a set that only its support points are
//! known of ([`gjk`](gjk())); and convex hulls in the plane ([`outline`](outline())).
//!
//! Support points, deepest points, distances and level distances are all `min f(v)` subject to
//! `c_i(v) <= 0` with smooth convex data, and all have a strictly feasible start at hand. The
//! solver is a primal-dual interior-point method without a tolerance of its own: the caller looks
//! at each iterate and stops when its own proven bracket is narrow enough. Solving allocates
//! nothing.

mod convex_hull_2d;
mod gjk;
mod interior_point;

pub use convex_hull_2d::{outline, turn};
pub use gjk::{Approach, Corner, gjk};
pub use interior_point::{Iterate, MAX_ROWS, Program, Row, Rows, minimise, minimise_within};
