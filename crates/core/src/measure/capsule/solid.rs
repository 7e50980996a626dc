//! The signed distance of a solid from a capsule: of all its parts the least.

use super::answer::CapsuleDistance;
use super::bounds::axis_gap;
use super::pair::Problem;
use super::shape::Capsule;
use crate::body::{Ball, Solid};
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::{At, Least, nearest_part};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;

/// The signed distance, or as much of it as the criterion needs.
pub(super) fn distance_until(
    (solid, pose): At<'_, impl Solid>,
    (capsule, capsule_pose): At<'_, Capsule>,
    goal: StopCriterion,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> CapsuleDistance {
    let tolerance = options.accuracy() * capsule.smaller_size_m(solid.circumscribed().radius);
    let problem = Problem { capsule, capsule_pose, tolerance, options, goal };
    let parts = solid.parts();
    if let [body] = parts {
        return problem.solve((body, pose), warm);
    }
    let bound = |ball: &Ball| axis_gap((ball, pose), (capsule, capsule_pose));
    let found = nearest_part(solid, bound, &goal, warm, |part, upper, hint| {
        // Deeper than the radius nothing is known of an axis that is not proven outside.
        let goal = StopCriterion { near: goal.near, far: goal.far.min(upper.max(-capsule.radius_m())) };
        Problem { goal, ..problem }.solve((&parts[part], pose), hint)
    });
    let Least { best, lower, tied, iterations, .. } = found;
    // The depth of something in a union does not follow from single parts.
    let lower = if lower < 0.0 { f64::NEG_INFINITY } else { lower };
    CapsuleDistance { status: Status::of(best.upper - lower <= tolerance), lower, tied, iterations, ..best }
}
