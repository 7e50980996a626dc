//! Brackets where doubles end: points, multipliers and bounds in double-double arithmetic.
//!
//! Rounding leaves the brackets of `bounds/duality_bounds` some hundred epsilon of the larger body
//! and of its distance wide, and those of level distances over needles that times the slope of the
//! needle's polynomial. Where that is too wide, Newton's method goes on with residuals of twice the
//! precision (iterative refinement), and the same inequalities are evaluated there: for two bodies
//! (`pair`), and for one beside a segment or a point (`axis`). Rounding then plays no part: what is
//! left is how near the iterates are to the solution.

mod axis;
mod body;
mod pair;

pub(in crate::measure) use axis::{Refined, RefinedAxis, RefinedOffset};
pub(in crate::measure) use pair::RefinedPair;
