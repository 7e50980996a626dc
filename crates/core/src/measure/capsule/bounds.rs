//! Bounds of the signed distance of a body from a capsule by balls and a plane: no polynomial is
//! evaluated.

use super::axes::{Axis, bounds_of_axes};
use super::shape::Capsule;
use crate::body::{Ball, Body};
use crate::measure::bounds::culling::{CULLING_SLACK, across};
use crate::measure::bounds::separation::across_gap;
use crate::measure::frames::pose::ROTATION_ERROR;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use nalgebra::Vector3;

/// What is known of a body and a capsule before a search.
#[derive(Clone, Copy, Debug)]
pub(super) struct EarlyBounds {
    /// Of the signed distance, metres.
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// Unit normal of the plane that was tried, from the capsule to the body; world frame.
    pub(super) facing: Option<Vector3<f64>>,
}

impl EarlyBounds {
    /// Nothing.
    pub(super) const NONE: Self = Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY, facing: None };
}

/// A bracket of the signed distance of a body from a capsule, as far as it may decide.
pub(super) fn early_bounds(of_body: At<'_, Body>, of_capsule: At<'_, Capsule>, goal: &StopCriterion) -> EarlyBounds {
    if runs(Stage::ClosedForm)
        && let Some(form) = of_body.0.closed_form()
        && let Some(ball) = Axis::of_ball(form, of_body.1)
    {
        let [lower, upper] = bounds_of_axes(&ball, &Axis::of_capsule(of_capsule.0, of_capsule.1), goal);
        return EarlyBounds { lower, upper, facing: None };
    }
    let lower = if runs(Stage::Balls) {
        axis_gap((of_body.0.circumscribed(), of_body.1), of_capsule)
    } else {
        f64::NEG_INFINITY
    };
    if lower > goal.far {
        return EarlyBounds { lower, ..EarlyBounds::NONE };
    }
    let known = ball_and_plane(of_body, of_capsule);
    EarlyBounds { lower: lower.max(known.lower), ..known }
}

/// Lower bound of the signed distance of all that is in a ball of the frame of a pose from the
/// capsule, metres.
pub(super) fn axis_gap((ball, pose): At<'_, Ball>, (capsule, capsule_pose): At<'_, Capsule>) -> f64 {
    let (between, apart, error) = across((pose, &ball.center), (capsule_pose, &Vector3::zeros()));
    let (half, reach) = (capsule.half_height_m(), ball.radius + capsule.reach_m());
    let axis = capsule_pose.transform_direction(&Vector3::z());
    let beside = (between - axis * axis.dot(&between).clamp(-half, half)).norm();
    let rounding = error + ROTATION_ERROR * half + CULLING_SLACK * (apart + reach);
    beside - ball.radius - capsule.radius_m() - rounding
}

/// From above by the ball about the body's interior point, from below by a plane across the gap
/// between the body and the place of the axis that is nearest to that point: not of closed forms,
/// of which a step costs no more than a plane.
fn ball_and_plane((body, pose): At<'_, Body>, (capsule, capsule_pose): At<'_, Capsule>) -> EarlyBounds {
    let (between, apart, error) = across((pose, body.interior_point()), (capsule_pose, &Vector3::zeros()));
    // Every point of the body is within its diameter of its interior point.
    let reach = 2.0 * body.circumscribed().radius + capsule.reach_m();
    let error = error + ROTATION_ERROR * reach + CULLING_SLACK * (apart + reach);
    let axis = capsule_pose.transform_direction(&Vector3::z());
    let (half, radius) = (capsule.half_height_m(), capsule.radius_m());
    let way = between - axis * axis.dot(&between).clamp(-half, half);
    let upper = if runs(Stage::Balls) { way.norm() - body.in_radius() - radius + error } else { f64::INFINITY };
    let ball = EarlyBounds { upper, ..EarlyBounds::NONE };
    if body.closed_form().is_some() && runs(Stage::ClosedForm) || !runs(Stage::Planes) {
        return ball;
    }
    let own_way = pose.rotation().inverse_transform_vector(&way);
    let shape = body.outline().shape();
    let entry = |i, j| shape[(i, j)] + if i == j { radius * radius } else { 0.0 };
    let Some(own) = across_gap(entry, &own_way).try_normalize(0.0) else { return ball };
    let n = pose.transform_direction(&own);
    let of_capsule = half * axis.dot(&n).abs() + radius;
    EarlyBounds { lower: n.dot(&between) - body.height(&-own) - of_capsule - error, facing: Some(n), ..ball }
}
