//! Robots in scenes: links that are objects, and joint values that say where they are.
//!
//! A [`Robot`] is what is loaded: kinematics, and for every link that can touch anything its
//! geometry. An instance of it has a name, a base pose and joint values, and puts one object for
//! every link with geometry into the scene, named `INSTANCE/LINK`, of the group `INSTANCE`.

mod derived_pairs;
mod frame_link;
mod id;
mod instance;
mod joints;
mod link_geometry;
mod link_pairs;
mod link_poses;
mod link_table;
mod model;
mod placement;
mod update;

pub use derived_pairs::{DeriveProgress, DerivedLinks};
pub use frame_link::FrameHolder;
pub(crate) use frame_link::FrameLink;
pub use id::{ParseRobotIdError, RobotId};
pub use instance::RobotInstance;
pub(crate) use instance::{Instance, Stance};
pub use joints::{JointsError, NamedJointValues};
pub(crate) use joints::{places, with_values};
pub use link_geometry::{PrimitiveError, primitive_bodies};
pub(crate) use link_poses::{isometry, link_error_m, pose_of};
pub(crate) use link_table::LinkTable;
pub use model::{Robot, RobotError, RobotLink};
pub use placement::PlaceRobot;
pub(crate) use update::{check_names, move_robots, place_robots, remove_robots};
