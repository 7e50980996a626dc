//! Bodies against sets with closed forms: boxes, cylinders, segments, points, and all points within
//! a radius of one. One smooth body is left to linearize; the other side costs no evaluation.

mod along_body;
mod beside;
mod crossed_cylinders;
mod cuboid;
mod cuboid_axes;
mod cylinder;
mod cylinder_axes;
mod distance;
mod growth;
mod lanes;
mod level;
mod line;
mod minimum;
mod newton;
mod placed;
mod point;
mod projectable;
mod segment;
mod separating_plane;
mod shape_pair;
mod shapes;
mod signed;
mod start;
mod thin_ellipsoid;

pub(in crate::measure) use cuboid::Cuboid;
pub(in crate::measure) use cylinder::Cylinder;
pub(in crate::measure) use distance::{ExactLost, ExactProven, ExactTrace, WORTH_A_BRACKET_SQUARED, common};
pub(in crate::measure) use growth::growth_of_shapes;
pub(in crate::measure) use lanes::{
    LaneBracket, LaneLeast, LaneMove, LaneOffset, LanePair, LaneSet, bracket, newton, start,
};
pub(in crate::measure) use line::{Line, Target};
pub(in crate::measure) use minimum::{LevelMinimum, LevelQuery};
pub(in crate::measure) use placed::{
    ExactContact, ExactQuery, active, direction_to_world, normals_towards, seen_from, to_world,
};
pub(in crate::measure) use point::{PointOffset, PointSide, offset_of_point, offset_of_vector};
pub(in crate::measure) use projectable::{Offset, Projectable};
pub(in crate::measure) use segment::Segment;
pub(in crate::measure) use separating_plane::{SeparatingPlane, separating_plane};
pub(in crate::measure) use shapes::{ShapeContact, ShapeDistance, between_shapes, contact_of_shapes};
pub(in crate::measure) use signed::{SignedShapes, signed_of_shapes};
pub(in crate::measure) use start::start as cold_start;
