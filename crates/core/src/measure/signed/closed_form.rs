//! The signed distance of two bodies with closed forms.

use super::answer::SignedDistance;
use super::report::Answer;
use crate::body::Body;
use crate::measure::distance::distance;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::depth::local_search::{ELSEWHERE, solid_tolerance};
use crate::measure::solver::exact_shape::{SignedShapes, signed_of_shapes};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};

/// The answer with its hint; the iterations spent for other bodies, and where the bracket is not as
/// narrow as asked for.
pub(super) fn of_shapes(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<SignedDistance, u32> {
    let (Some(form_a), Some(form_b)) = (a.closed_form(), b.closed_form()) else { return Err(0) };
    let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose_a.transform_point(x_a)) } else { None };
    let how = (start.as_ref(), options);
    let found = signed_of_shapes((form_a, pose_a), (form_b, pose_b), ELSEWHERE, how);
    if let Some(SignedShapes::Signed(found)) = found {
        let (lower, upper) = (found.lower, found.upper);
        let tolerance = solid_tolerance(a, b, options, if upper < 0.0 { -lower } else { 0.0 });
        let tied = lower < 0.0 && found.elsewhere <= 2.0 * tolerance - lower;
        if upper - lower > tolerance || !(found.is_aligned || tied) {
            return Err(found.steps);
        }
        warm.hint = Hint::Shapes { x_a: pose_a.inverse_transform_point(&found.witness_a) };
        let answer = Answer { lower, upper, tied, iterations: found.steps, status: Status::Converged };
        return Ok(answer.report((found.witness_a, found.witness_b), Some(found.normal), pose_a, pose_b));
    }
    let is_of_shapes = matches!(warm.hint, Hint::Cold | Hint::Shapes { .. });
    // Where the last answer is that of an overlap without a closed form, the next is likely to be.
    if found.is_none() && !is_of_shapes {
        return Err(0);
    }
    let mut hint = if is_of_shapes { *warm } else { WarmStart::default() };
    let apart = distance(a, pose_a, b, pose_b, options, &mut hint);
    if !(apart.lower > 0.0) || apart.status != Status::Converged {
        return Err(apart.iterations);
    }
    warm.hint = hint.hint;
    let (lower, upper, iterations, status) = (apart.lower, apart.upper, apart.iterations, apart.status);
    let answer = Answer { lower, upper, tied: false, iterations, status };
    Ok(answer.report((apart.witness_a, apart.witness_b), apart.normal, pose_a, pose_b))
}
