//! The penetration depth of two bodies with closed forms.

use super::answer::Penetration;
use crate::body::{Body, ClosedForm};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::depth::local_search::{ELSEWHERE, solid_tolerance};
use crate::measure::solver::exact_shape::{SignedShapes, signed_of_shapes};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use nalgebra::Vector3;

/// The answer with its hint, of balls, boxes and cylinders; none where the bracket is not as narrow
/// as asked for.
pub(super) fn of_shapes(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Option<Penetration> {
    let (form_a, form_b) = (a.closed_form()?, b.closed_form()?);
    let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose_a.transform_point(x_a)) } else { None };
    let how = (start.as_ref(), options);
    let apart = Penetration {
        status: Status::Converged,
        lower: 0.0,
        upper: 0.0,
        direction: None,
        witness_a: Vector3::zeros(),
        witness_b: Vector3::zeros(),
        tied: false,
        directions: 0,
        iterations: 0,
    };
    let found = match signed_of_shapes((form_a, pose_a), (form_b, pose_b), ELSEWHERE, how)? {
        SignedShapes::Apart(n) => {
            let (witness_a, witness_b) = (farthest((form_a, pose_a), -n), farthest((form_b, pose_b), n));
            warm.hint = Hint::Shapes { x_a: pose_a.inverse_transform_point(&witness_a) };
            return Some(Penetration { witness_a, witness_b, ..apart });
        }
        SignedShapes::Signed(found) => found,
    };
    let (lower, upper) = ((-found.upper).max(0.0), (-found.lower).max(0.0));
    let tolerance = solid_tolerance(a, b, options, upper);
    let tied = upper > 0.0 && found.elsewhere <= upper + 2.0 * tolerance;
    if upper - lower > tolerance || upper > 0.0 && !(found.is_aligned || tied) {
        return None;
    }
    warm.hint = Hint::Shapes { x_a: pose_a.inverse_transform_point(&found.witness_a) };
    Some(Penetration {
        lower,
        upper,
        direction: Some(found.normal).filter(|_| upper > 0.0),
        witness_a: found.witness_a,
        witness_b: found.witness_b,
        tied,
        iterations: found.steps,
        ..apart
    })
}

/// A point of a shape that is farthest along n, world frame.
fn farthest((form, pose): (&ClosedForm, &Pose), n: Vector3<f64>) -> Vector3<f64> {
    pose.transform_point(&form.support_point(&pose.rotation().inverse_transform_vector(&n)))
}
