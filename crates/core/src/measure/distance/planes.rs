//! Lower bounds of a distance by planes across a few directions, the likeliest first.

use crate::body::Body;
use crate::measure::bounds::separation::Separation;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::V3;
use crate::measure::solver::exact_shape::normals_towards;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::Hint;
use nalgebra::Vector3;

/// Most that a plane loses to the rounding up of heights in tables, of the radii of both bodies.
///
/// Larger, planes that would decide are left out; smaller, more are tried in vain. It changes time
/// only; no test pins it.
const SETTLED: f64 = 0.02;

/// What planes between two bodies show.
pub(super) struct Planes {
    /// The best lower bound of the distance, metres, or the first beyond which a goal asks for no
    /// more.
    pub(super) lower: f64,
    /// About the normal across the gap, which a search can start from: unit vector from B to A, A's
    /// frame.
    pub(super) facing: Option<V3<f64>>,
}

/// Planes across the likeliest directions between two bodies, until one shows what a goal asks for:
/// across the normal of the last answer, along the line of the centres, about across the gap, or
/// across the sides of a shape that the other body's centre lies beyond. Searches look across the
/// gap as soon as they know where it is.
///
/// The last witnesses where they stand now bound what any plane can show: none is tried where they
/// are too near for the goal, and none after that of the last normal where it is within
/// [`SETTLED`] of them.
pub(super) fn planes_between(of_a: (&Body, &Pose), of_b: (&Body, &Pose), hint: &Hint, goal: &StopCriterion) -> Planes {
    let ((a, pose_a), (b, pose_b)) = (of_a, of_b);
    let mut best = f64::NEG_INFINITY;
    let alone = |lower| Planes { lower, facing: None };
    let forms = [b, a].map(Body::closed_form).map(|form| form.filter(|form| form.shape().ball_radius_m().is_none()));
    let last = hint.witnesses(a, b).zip(hint.normal_a());
    let apart = |[x, y]: [Vector3<f64>; 2]| (pose_a.transform_point(&x) - pose_b.transform_point(&y)).norm();
    let last = last.map(|(witnesses, normal)| (apart(witnesses), normal));
    if last.is_some_and(|(apart, _)| apart <= goal.far) {
        return alone(best);
    }
    let separation = Separation::new(of_a, of_b);
    if let Some((apart, normal)) = last {
        best = separation.along(&normal);
        let settled = SETTLED * (a.circumscribed().radius + b.circumscribed().radius);
        if best > goal.far || apart - best <= settled {
            return alone(best);
        }
    }
    let mut meets = |n: &Vector3<f64>| {
        best = best.max(separation.along(n));
        best > goal.far
    };
    if forms.iter().all(Option::is_none) {
        if meets(separation.between()) {
            return alone(best);
        }
        let facing = separation.facing();
        if meets(&facing) {
            return alone(best);
        }
        return Planes { lower: best, facing: facing.try_normalize(0.0).map(V3::from) };
    }
    let both = forms.iter().all(Option::is_some);
    for (form, of_form, of_other, sign) in [(forms[0], of_b, of_a, 1.0), (forms[1], of_a, of_b, -1.0)] {
        let Some(form) = form else { continue };
        let point = of_other.1.transform_point(of_other.0.interior_point());
        let (normals, count) = normals_towards(form, of_form.1, &point);
        let own = |n: &Vector3<f64>| pose_a.rotation().inverse_transform_vector(n) * sign;
        // The search between two shapes finds their other sides itself.
        let count = if both { count.min(1) } else { count };
        if normals[..count].iter().any(|n| meets(&own(n))) || both {
            break;
        }
    }
    alone(best)
}
