//! Points that are known up to rounding.

use nalgebra::Vector3;

/// A point known up to rounding, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Its rounded coordinates.
    pub x: Vector3<f64>,
    /// Bound of the distance of the exact point from there; 0 for a corner of the mesh.
    pub radius: f64,
}

impl Spot {
    /// The point `p + t (q - p)` for t in [0, 1].
    pub(super) fn between(p: &Self, q: &Self, t: f64) -> Self {
        // Of the difference, the product and the sum, each at most half an ε of |p| + |q|, and
        // again as much for this bound; numbers too small to be rounded in proportion are off by
        // less than the least normal one.
        let rounding = 2.0 * f64::EPSILON * (p.x.norm() + q.x.norm()) + f64::MIN_POSITIVE;
        Self { x: p.x + (q.x - p.x) * t, radius: (p.radius.max(q.radius) + rounding) * (1.0 + 2.0 * f64::EPSILON) }
    }
}
