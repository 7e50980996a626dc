//! What contains an object where it stands, to tell pairs apart before their shapes are looked at.

use nalgebra::Vector3;

use super::thing::{OrientedBox, Thing};
use crate::broad_phase::WorldBall;

/// A ball and a box in the frame of the object, world frame, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    ball: RoundedBall,
    bounds: OrientedBox,
}

/// A ball whose radius takes in what rounds where two of them are compared.
#[derive(Clone, Copy, Debug)]
struct RoundedBall {
    center: Vector3<f64>,
    radius: f64,
}

impl Around {
    /// None of half-spaces.
    pub(crate) fn new(thing: &Thing<'_>) -> Option<Self> {
        let (center, radius): WorldBall = thing.ball()?;
        let radius = radius + 32.0 * f64::EPSILON * (center.norm() + radius);
        Some(Self { ball: RoundedBall { center, radius }, bounds: thing.oriented_box()? })
    }

    /// Whether the balls may be within a threshold, metres. Most pairs are not, and need no root.
    pub(crate) fn is_near(&self, other: &Self, threshold: f64) -> bool {
        let (a, b) = (&self.ball, &other.ball);
        let reach = a.radius + b.radius + threshold;
        reach >= 0.0 && (a.center - b.center).norm_squared() <= reach * reach * (1.0 + 16.0 * f64::EPSILON)
    }

    /// Whether the boxes may be within a threshold, metres.
    pub(crate) fn may_meet(&self, other: &Self, threshold: f64) -> bool {
        // How deep boxes overlap says nothing of how deep what they contain does.
        threshold < 0.0 || self.bounds.gap_m(&other.bounds) <= threshold
    }
}
