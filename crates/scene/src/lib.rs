//! Scenes: named objects with poses, a revision, and the pairs that may touch.
//!
//! A [`Scene`] is an immutable snapshot. [`Scene::updated`] checks a whole [`Update`] and then
//! makes the next snapshot, one revision on; readers keep the snapshot they hold. Nothing here
//! depends on storage or on the network. Lengths are metres, poses map body frame to world frame.

mod limits;
mod snapshot;
mod update;

pub use limits::{MAX_ALLOWED_PAIRS, MAX_NAME_BYTES, MAX_OBJECTS};
pub use snapshot::{NameError, Object, Scene, check_name};
pub use update::{Entry, List, Placement, SceneError, Update};
