//! What stands in place of the second body of a pair, for measures of one body.

use sublevel::body::Body;
use sublevel::measure::{Capsule, HalfSpace, Pose};
use sublevel_testkit::catalogue::primitives::Shape;

/// A capsule as thick as the ball inside the body, about as long as the ball about it; of smooth
/// bodies a segment.
pub(crate) fn capsule(body: &Body) -> Capsule {
    let (thin, long) = (body.in_radius(), body.circumscribed().radius);
    let radius = if body.is_smooth() { 0.0 } else { thin };
    Capsule::new(radius, (long - thin).max(0.5 * thin)).expect("sizes of a body")
}

/// Below the plane across the z axis of a pose.
pub(crate) fn half_space(pose: &Pose) -> HalfSpace {
    Shape::half_space(pose)
}
