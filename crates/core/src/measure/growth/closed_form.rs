//! The growth distance of two bodies with closed forms.

use super::answer::GrowthDistance;
use crate::body::{Body, ClosedForm};
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::exact_shape::growth_of_shapes;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};

/// The answer with its hint, of balls, boxes and cylinders that grow about their centres; the
/// iterations spent for other bodies, and where the bracket is not as narrow as asked for.
pub(super) fn of_shapes(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<GrowthDistance, u32> {
    let (Some(form_a), Some(form_b)) = (a.closed_form(), b.closed_form()) else { return Err(0) };
    let about = |body: &Body, form: &ClosedForm| body.growth_ball().center == *form.center();
    if !(about(a, form_a) && about(b, form_b)) {
        return Err(0);
    }
    let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose_a.transform_point(x_a)) } else { None };
    let radii = [a.growth_ball().radius, b.growth_ball().radius];
    let found = growth_of_shapes((form_a, pose_a), (form_b, pose_b), radii, start.as_ref(), options)?;
    let (lower, upper, normal, witness) = (found.lower, found.upper, found.normal, found.witness);
    if !(upper - lower <= options.accuracy() * upper.max(1.0)) {
        return Err(found.steps);
    }
    warm.hint = Hint::Shapes { x_a: pose_a.inverse_transform_point(&found.of_a) };
    // Against the vector from A's centre to B's.
    let slope = normal / found.width;
    Ok(GrowthDistance {
        status: Status::Converged,
        lower,
        upper,
        witness,
        normal: Some(normal),
        gradients: Some([
            Twist::of_gradient(slope, &witness, pose_a.translation()),
            Twist::of_gradient(-slope, &witness, pose_b.translation()),
        ]),
        tied: false,
        iterations: found.steps,
    })
}
