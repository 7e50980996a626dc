//! What is lost without a stage of a search, counted: each stage is switched off alone, and the
//! queries at which it came to its turn are solved once more, from the same hint.
//!
//! The bench counts by these files, and so does a unit test of the measures, whose bodies and poses
//! are types of their own: both have a module `library` beside this one.

mod draws;
mod families;
mod query;
mod rescues;
mod table;

pub(crate) use draws::{Others, bodies, draws};
pub(crate) use families::families;
pub(crate) use rescues::rescues;
pub(crate) use table::Table;
