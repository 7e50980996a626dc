//! The distance of a ball from a ball, a box or a cylinder.

use super::answer::Distance;
use crate::body::ClosedForm;
use crate::measure::bounds::culling::across;
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::exact_shape::{PointOffset, PointSide, active, offset_of_vector};
use crate::measure::solver::tangent_newton::ALIGNED;
use crate::measure::status::Status;

/// Rounding of sums of lengths, relative to their magnitudes; dimensionless. Eight operations of
/// half an epsilon each, and as much to spare.
///
/// A smaller value could make the bracket of two balls miss their distance; a larger one leaves
/// more pairs to the general search. Exercised by `two_balls_have_a_formula`.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// The distance of two shapes that are balls; none of others, at contact within rounding, and where
/// rounding leaves the bracket wider than asked for.
#[inline(always)]
pub(super) fn of_balls(
    (form_a, pose_a): (&ClosedForm, &Pose),
    (form_b, pose_b): (&ClosedForm, &Pose),
    options: &Options<'_>,
) -> Option<Distance> {
    let (of_a, of_b) = (form_a.shape().ball_radius_m()?, form_b.shape().ball_radius_m()?);
    let (between, apart, error) = across((pose_a, form_a.center()), (pose_b, form_b.center()));
    let gap = apart - of_a - of_b;
    let slack = error + form_a.displacement_m() + form_b.displacement_m() + ROUNDING * (apart + of_a + of_b);
    let is_proven = gap.abs() > slack && 2.0 * slack <= options.accuracy() * of_a.min(of_b);
    if !is_proven || options.exhausted(0) {
        return None;
    }
    let center = pose_a.transform_point(form_a.center());
    if gap < 0.0 {
        let common = center - between * (of_a / (of_a + of_b));
        let (status, upper) = (Status::Converged, 0.0);
        return Some(Distance { status, upper, witness_a: common, witness_b: common, ..Distance::default() });
    }
    let n = between / apart;
    Some(Distance {
        status: Status::Converged,
        lower: gap - slack,
        upper: gap + slack,
        witness_a: center - n * of_a,
        witness_b: center - n * (apart - of_b),
        normal: Some(n),
        // The gradient of |x|² / r² is 2 / r there.
        active_a: ActiveConstraints::single(0, 0.5 * of_a),
        active_b: ActiveConstraints::single(0, 0.5 * of_b),
        parts: [0, 0],
        tied: false,
        iterations: 0,
    })
}

/// The distance of a ball from a shape that is none, whichever comes first: that of its centre less
/// the radius. None of others, at contact within rounding, and where rounding leaves the bracket
/// wider than asked for or the normal uncertain.
#[inline(always)]
pub(super) fn of_ball_beside(
    (form_a, pose_a): (&ClosedForm, &Pose),
    (form_b, pose_b): (&ClosedForm, &Pose),
    options: &Options<'_>,
) -> Option<Distance> {
    let (swapped, radius, (ball, pose), (form, form_pose)) =
        match (form_a.shape().ball_radius_m(), form_b.shape().ball_radius_m()) {
            (Some(radius), None) => (false, radius, (form_a, pose_a), (form_b, pose_b)),
            (None, Some(radius)) => (true, radius, (form_b, pose_b), (form_a, pose_a)),
            _ => return None,
        };
    if options.exhausted(0) {
        return None;
    }
    let (offset, arm) = (pose.translation() - form_pose.translation(), pose.transform_direction(ball.center()));
    let error = RELATIVE_ERROR * (offset.norm() + ball.center().norm()) + ball.displacement_m();
    let common = |witness| Distance {
        status: Status::Converged,
        upper: 0.0,
        witness_a: witness,
        witness_b: witness,
        ..Distance::default()
    };
    let center = pose.translation() + arm;
    let PointOffset { lower, upper, normal, own_normal, witness } =
        match offset_of_vector((form, form_pose), &(offset + arm), error) {
            PointSide::Inside => return Some(common(center)),
            PointSide::Outside(found) => found,
            PointSide::Open => return None,
        };
    let rounding = ROUNDING * (upper + radius);
    let (gap, most) = (lower - radius - rounding, upper - radius + rounding);
    if most < 0.0 {
        return Some(common(witness));
    }
    // A normal at an edge is off by what places are, over the distance.
    let is_aligned = upper - lower <= ALIGNED * lower;
    if !(gap > 0.0 && is_aligned && most - gap <= options.accuracy() * radius.min(form.reach_m())) {
        return None;
    }
    let on_ball = center - normal * radius;
    let (of_ball, of_form) = (ActiveConstraints::single(0, 0.5 * radius), active(form.shape(), own_normal));
    let found = Distance { status: Status::Converged, lower: gap, upper: most, ..Distance::default() };
    Some(if swapped {
        let (active_a, active_b) = (of_form, of_ball);
        Distance { witness_a: witness, witness_b: on_ball, normal: Some(-normal), active_a, active_b, ..found }
    } else {
        let (active_a, active_b) = (of_ball, of_form);
        Distance { witness_a: on_ball, witness_b: witness, normal: Some(normal), active_a, active_b, ..found }
    })
}
