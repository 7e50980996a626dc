//! A ray as seen from a point of a body's frame.

use super::ray::Ray;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::solver::convex_root_bracket::Entry;
use crate::polynomial::gamma;
use nalgebra::{Matrix3, Vector3};

/// A ray in the frame of a body: `x(τ) = c + closest + τ direction`, c a point of the body.
pub(in crate::measure) struct Approach {
    /// Parameter of the ray at τ = 0, metres: there it is closest to c.
    pub(in crate::measure) base: f64,
    pub(super) closest: Vector3<f64>,
    pub(super) direction: Vector3<f64>,
    /// Bound of the error of the closest point, metres, and of the direction.
    pub(super) errors: (f64, f64),
    /// Where the ray is within a radius of c.
    pub(in crate::measure) entry: Entry,
}

impl Approach {
    /// The ray as seen from a point, body frame, if it passes within a radius of it; metres.
    #[inline(always)]
    pub(in crate::measure) fn within(radius: f64, center: &Vector3<f64>, pose: &Pose, ray: &Ray) -> Option<Self> {
        // Relative to lengths, of what the pose has turned.
        let turned = ROTATION_ERROR + gamma(16);
        let turn: Matrix3<f64> = pose.rotation().to_rotation_matrix().into_inner();
        let offset = ray.origin - pose.translation();
        let direction = turn.tr_mul(&ray.direction);
        let from_center = turn.tr_mul(&offset) - center;
        let base = -from_center.dot(&direction);
        let closest = from_center + direction * base;
        let far = offset.norm() + base.abs() + 2.0 * radius;
        let moved = turned * far + gamma(8) * center.norm();
        let reach = radius * (1.0 + 1e-14) + moved;
        let half = reach * reach - closest.norm_squared();
        if half < 0.0 {
            return None;
        }
        let half = half.sqrt() * (1.0 + 1e-14) + moved;
        let entry = Entry::between((-half).max(-base), half.min(ray.max_length - base));
        Some(Self { base, closest, direction, errors: (moved, turned), entry })
    }
}
