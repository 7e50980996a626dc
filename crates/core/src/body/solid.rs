//! What bodies, compounds and the shapes of files have in common.

use super::bounds::{Aabb, Ball};
use super::convex_body::Body;
use super::id::BodyId;
use super::part_tree::PartTree;

/// What measures need of a solid: the convex bodies it is the union of, all in one frame, and a
/// ball around them.
///
/// A [`Body`] is the union of itself; a measure of a single body takes no longer for this.
pub trait Solid: Sealed {
    /// The parts, at least one and at most [`MAX_PARTS`](super::MAX_PARTS).
    fn parts(&self) -> &[Body];
    /// The hash of its content.
    fn id(&self) -> &BodyId;
    /// A ball proven to contain all parts, metres.
    fn circumscribed(&self) -> &Ball;
    /// A box proven to contain all parts, metres.
    fn bounding_box(&self) -> &Aabb;
    /// A tree of balls around the parts; none of a single body.
    fn tree(&self) -> Option<&PartTree>;
}

/// Keeps the promise of at least one part: nobody else can implement [`Solid`].
pub trait Sealed {}

impl Sealed for Body {}

impl Solid for Body {
    #[inline]
    fn parts(&self) -> &[Body] {
        std::slice::from_ref(self)
    }

    #[inline]
    fn id(&self) -> &BodyId {
        Body::id(self)
    }

    fn circumscribed(&self) -> &Ball {
        Body::circumscribed(self)
    }

    fn bounding_box(&self) -> &Aabb {
        Body::bounding_box(self)
    }

    fn tree(&self) -> Option<&PartTree> {
        None
    }
}
