//! Newton's method for a smooth body, or for a set with a closed form, against a set with a closed
//! form at several poses, one in each lane of the vectors. A lane selects where a single query
//! branches ([`super::distance`], [`super::shape_pair`]), and gives up where that one tries
//! something else.

mod bracket;
mod least;
mod newton;
mod pair;
mod set;
mod start;

pub(in crate::measure) use bracket::{LaneBracket, bracket};
pub(in crate::measure) use least::LaneLeast;
pub(in crate::measure) use newton::{LaneMove, newton};
pub(in crate::measure) use pair::LanePair;
pub(in crate::measure) use set::{LaneOffset, LaneSet};
pub(in crate::measure) use start::start;
