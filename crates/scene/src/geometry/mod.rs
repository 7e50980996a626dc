//! What an object is made of: bodies, compounds, ladders, sos-bodies, capsules and half-spaces,
//! and their files.

mod capsule;
mod file;
mod half_space;
mod kinds;
mod ladder;

pub use capsule::NamedCapsule;
pub use file::GeometryFileError;
pub use half_space::NamedHalfSpace;
pub use kinds::Geometry;
pub use ladder::{Ladder, LadderError, MAX_RUNGS};
