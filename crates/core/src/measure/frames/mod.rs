//! Frames and motions: poses of bodies, the frame in which a query is solved, small vectors in it.

pub(super) mod motion;
pub(super) mod pose;
pub(super) mod quaternion;
pub(super) mod query_frame;
pub(super) mod twist;
pub(super) mod vector;
