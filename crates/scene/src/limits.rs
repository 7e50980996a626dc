//! How large a scene may be.

/// Longest name of a scene, object or group, in bytes.
pub const MAX_NAME_BYTES: usize = 128;

/// Most objects in one scene.
pub const MAX_OBJECTS: usize = 1 << 17;

/// Most robots in one scene.
pub const MAX_ROBOTS: usize = 1 << 12;

/// Most allowed pairs, and most pairs with a padding, in one scene.
pub const MAX_PAIR_RULES: usize = 1 << 16;

/// Largest padding of an object, group or pair, either way, metres: beyond it every pair is a
/// candidate and the tree is of no use.
pub const MAX_PADDING_M: f64 = 1e3;
