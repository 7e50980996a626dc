//! How far a body reaches along a direction, as asked for and as known.

use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::tangent_newton::ALIGNED;
use nalgebra::Vector3;

/// Bracket of `max n·(x - c)` over the points x of a body, c the centre of its normalization.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Height {
    /// Attained by the point but for its rounding, metres.
    pub(in crate::measure) lower: f64,
    /// Metres.
    pub(in crate::measure) upper: f64,
    /// Point of the body that is farthest, body frame, metres.
    pub(in crate::measure) point: Vector3<f64>,
    /// The constraints active there; none of shapes with a closed form.
    pub(in crate::measure) active: ActiveSet,
    pub(in crate::measure) iterations: u32,
}

/// How accurate a height has to be.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Asked {
    /// Largest width of its bracket, metres.
    pub(in crate::measure) tolerance: f64,
    /// Largest angle between the direction and a normal at a point that Newton's method ends at,
    /// radians.
    pub(in crate::measure) angle: f64,
}

impl Asked {
    /// A bracket of this width, metres, at a point that gradients can be taken at.
    pub(in crate::measure) fn narrow(tolerance: f64) -> Self {
        Self { tolerance, angle: ALIGNED }
    }

    /// A bracket of this width, metres, wherever the point is.
    pub(in crate::measure) fn within(tolerance: f64) -> Self {
        Self { tolerance, angle: f64::INFINITY }
    }
}
