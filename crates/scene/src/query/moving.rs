//! What every state places.

use std::sync::Arc;

use sublevel_core::measure::Pose;

use crate::object::{Object, Slot};

/// An object that every state places.
#[derive(Debug)]
pub(crate) struct Moving {
    pub(crate) slot: Slot,
    pub(crate) object: Arc<Object>,
    /// Position of what holds it among the moving, and its place there; none if it is named.
    pub(crate) holder: Option<(usize, Pose)>,
    /// Of states of a robot: the link that it moves with.
    pub(crate) link: Option<usize>,
    /// No point of it is farther from the origin of that link, or of its own, metres.
    pub(crate) reach_m: f64,
    /// Length of the way from the origin of the link to its own, metres.
    way_m: f64,
    /// Through how many others it is held.
    pub(crate) holders: u32,
}

impl Moving {
    /// An object that states place by itself.
    pub(crate) fn named(slot: Slot, object: &Arc<Object>) -> Self {
        let link = object.link.as_ref().map(|of| of.link);
        let reach_m = reach_m(object, 0.0);
        Self { slot, object: object.clone(), holder: None, link, way_m: 0.0, reach_m, holders: 0 }
    }

    /// An object that another one holds, which is given with its position.
    pub(crate) fn held(slot: Slot, object: &Arc<Object>, (holder, position): (&Self, usize), place: Pose) -> Self {
        let way_m = holder.way_m + place.translation().norm();
        let reach_m = reach_m(object, way_m);
        let (link, holders) = (holder.link, holder.holders + 1);
        Self { slot, object: object.clone(), holder: Some((position, place)), link, way_m, reach_m, holders }
    }
}

/// Radius of a ball around an object about a point that is so far from its origin; half-spaces have
/// none.
fn reach_m(object: &Object, way_m: f64) -> f64 {
    let ball = object.ball().map_or(f64::INFINITY, |ball| ball.center.norm() + ball.radius);
    (way_m + ball) * (1.0 + 64.0 * f64::EPSILON)
}
