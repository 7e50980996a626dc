//! What a ray, or a ball swept along it, meets.

use crate::measure::status::Status;
use nalgebra::Vector3;

/// What a ray, or a ball swept along it, meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayCast {
    /// Nothing: proven.
    Miss,
    /// The body: proven, with a bracket of where it is entered.
    Hit(RayHit),
    /// The ray passes within rounding of the surface, or the iterations ran out: if it enters the
    /// body at all, then first between these two parameters, metres.
    Undecided {
        /// No point of the body comes before; proven.
        lower: f64,
        /// The first point of the body, if there is one, does not come after; proven.
        upper: f64,
    },
}

impl RayCast {
    /// The hit, if there is one.
    pub fn hit(&self) -> Option<&RayHit> {
        if let Self::Hit(hit) = self { Some(hit) } else { None }
    }
}

/// Where a body is entered; metres, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// How the solve ended.
    pub status: Status,
    /// No point of the body comes before this parameter; proven. 0 if the ray starts inside.
    pub lower: f64,
    /// The ray has entered the body by this parameter; proven. 0 if the ray starts inside.
    pub upper: f64,
    /// The point of the ray at `upper`; for a swept ball the point of the body that it touches.
    pub point: Vector3<f64>,
    /// Outward unit normal there; none if the ray starts inside.
    pub normal: Option<Vector3<f64>>,
    /// Iterations.
    pub iterations: u32,
}
