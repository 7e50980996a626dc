//! Newton's method for a smooth body against a set with a closed form at several poses, one in each
//! lane of the vectors. A lane selects where a single query branches ([`super::distance`]), and
//! gives up where that one tries something else.

mod bracket;
mod newton;
mod set;
mod start;

pub(in crate::measure) use bracket::{LaneBracket, bracket};
pub(in crate::measure) use newton::{LaneMove, newton};
pub(in crate::measure) use set::{LaneOffset, LaneSet};
pub(in crate::measure) use start::start;
