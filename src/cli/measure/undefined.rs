//! What `sublevel measure` does not measure, and what to do then.

/// Why two objects are not measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Undefined {
    /// Two half-spaces.
    #[error("two half-spaces have no distance; measure a body against each of them")]
    HalfSpaces,
    /// A capsule and an sos-body.
    #[error(
        "the distance of a capsule and an sos-body is not known: in place of the capsule measure a cylinder and the balls at \
         its ends ('sublevel primitive'), or in place of the sos-body a convex body around it ('sublevel fit --group')"
    )]
    CapsuleAndSet,
    /// Times of other measures.
    #[error(
        "--time is for two bodies, compounds or ladders; leave it out, or measure convex bodies around sos-bodies \
         ('sublevel fit --group') and cylinders or boxes in place of capsules and half-spaces"
    )]
    Time,
}
