//! Scenes: named objects with poses, a revision, and the pairs that may touch.
//!
//! A [`Scene`] is an immutable snapshot. [`Scene::updated`] checks a whole [`Update`] and then
//! makes the next snapshot, one revision on; readers keep the snapshot they hold. Nothing here
//! knows of disks or wires. Lengths are metres, poses map body frame to world frame.

mod snapshot;
mod update;

pub use snapshot::{NameError, Object, Scene, check_name};
pub use update::{Entry, List, Placement, SceneError, Update};

/// Longest name of a scene, object or group, in bytes.
pub const MAX_NAME_BYTES: usize = 128;

/// Most objects in one scene. With [`MAX_NAME_BYTES`] and [`MAX_ALLOWED_PAIRS`] it keeps a whole
/// scene within one gRPC message of 4 MiB.
pub const MAX_OBJECTS: usize = 4096;

/// Most allowed pairs in one scene.
pub const MAX_ALLOWED_PAIRS: usize = 8192;
