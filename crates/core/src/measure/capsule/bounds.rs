//! Bounds of the signed distance of a body from a capsule by a ball and a plane: no polynomial is
//! evaluated.

use super::shape::Capsule;
use crate::body::Body;
use crate::measure::bounds::culling::{CULLING_SLACK, across};
use crate::measure::frames::pose::ROTATION_ERROR;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::stages::{Stage, runs};
use nalgebra::Vector3;

/// A bracket of the signed distance of a body from a capsule, metres: from above by the ball about
/// the body's interior point, from below by the plane across the way to that point from the nearest
/// one of the axis.
pub(super) fn ball_and_plane((body, pose): At<'_, Body>, (capsule, capsule_pose): At<'_, Capsule>) -> [f64; 2] {
    let (between, apart, error) = across((pose, body.interior_point()), (capsule_pose, &Vector3::zeros()));
    // Every point of the body is within its diameter of its interior point.
    let reach = 2.0 * body.circumscribed().radius + capsule.reach_m();
    let error = error + ROTATION_ERROR * reach + CULLING_SLACK * (apart + reach);
    let axis = capsule_pose.transform_direction(&Vector3::z());
    let (half, radius) = (capsule.half_height_m(), capsule.radius_m());
    let way = between - axis * axis.dot(&between).clamp(-half, half);
    let upper = if runs(Stage::Balls) { way.norm() - body.in_radius() - radius + error } else { f64::INFINITY };
    let Some(n) = way.try_normalize(0.0).filter(|_| runs(Stage::Planes)) else { return [f64::NEG_INFINITY, upper] };
    let of_capsule = half * axis.dot(&n).abs() + radius;
    let of_body = body.height(&-pose.rotation().inverse_transform_vector(&n));
    [n.dot(&between) - of_body - of_capsule - error, upper]
}
