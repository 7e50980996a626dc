//! The distance of two balls.

use super::answer::Distance;
use crate::body::ClosedForm;
use crate::measure::bounds::culling::across;
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
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
