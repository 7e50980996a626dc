//! Proven bounds that any trial points and multipliers give.

pub(super) mod culling;
pub(super) mod duality_bounds;
pub(super) mod separation;
