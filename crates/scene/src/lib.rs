//! Scenes: named objects with poses, a revision, and the questions that are asked of them.
//!
//! A [`Scene`] is an immutable snapshot. [`Scene::updated`] checks a whole [`Update`] and then
//! makes the next snapshot, one revision on; readers keep the snapshot they hold, and snapshots and
//! forks share whatever is equal. Questions ([`query`]) are split over the threads of a [`Crew`].
//! Nothing here depends on storage or on the network. Lengths are metres, poses map body frame to
//! world frame.

mod broad_phase;
mod crew;
mod error;
mod geometry;
mod limits;
mod name;
mod object;
mod own_starts;
mod pair_cache;
mod poses;
pub mod query;
mod robot;
mod rules;
mod scene;
mod structure;
mod update;

pub use crew::{Crew, Panicked, Question, Stop};
pub use error::{Entry, List, Part, SceneError};
pub use geometry::{Geometry, GeometryFileError, Ladder, LadderError, MAX_RUNGS, NamedCapsule, NamedHalfSpace};
pub use limits::{MAX_NAME_BYTES, MAX_OBJECTS, MAX_PADDING_M, MAX_PAIR_RULES, MAX_ROBOTS};
pub use name::{NameError, check_name};
pub use object::{Attachment, LinkOf, Object, Slot, Subject};
pub use own_starts::OwnStarts;
pub use pair_cache::WarmStartUse;
pub use robot::{
    DeriveProgress, DerivedLinks, FrameHolder, JointsError, NamedJointValues, ParseRobotIdError, PlaceRobot,
    PrimitiveError, Robot, RobotError, RobotId, RobotInstance, RobotLink, primitive_bodies,
};
pub use rules::{Rules, SubjectPair};
pub use scene::Scene;
pub use update::{Attach, Placement, Update};
