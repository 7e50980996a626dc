//! How large a scene may be.

/// Longest name of a scene, object or group, in bytes.
pub const MAX_NAME_BYTES: usize = 128;

/// Most objects in one scene. With [`MAX_NAME_BYTES`] and [`MAX_ALLOWED_PAIRS`] it keeps a whole
/// scene within one gRPC message of 4 MiB.
pub const MAX_OBJECTS: usize = 4096;

/// Most allowed pairs in one scene.
pub const MAX_ALLOWED_PAIRS: usize = 8192;
