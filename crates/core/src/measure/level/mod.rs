//! Level distance `d(A‖B) = min p_A(x)` over x in B, p the largest constraint.

mod answer;
mod over_shape;
mod pair;
mod saturated;
mod search;
#[cfg(test)]
mod tests;

use crate::body::{Body, Solid};
use crate::measure::bounds::culling::{CULLING_SLACK, across};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::{At, least};
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
pub use answer::LevelDistance;
use pair::between;

/// Level distance of `a` over `b`: the smallest value that the stored polynomial of `a` (the
/// largest of its constraints) takes on `b`. Above 1 the bodies are apart, at 1 they touch, below 1
/// they overlap; it is not symmetric.
///
/// The bracket is as narrow as `options` ask, relative to `max(1, |d|)`, or the status says that it
/// is not. When the minimiser of `a`'s polynomial lies in `b`, the answer is its minimum
/// ([`Body::min_value`]) and says no more about depth. Derivatives are by the envelope theorem: at
/// the minimiser x the gradients of both bodies balance, `g_a + μ g_b = 0`. `warm` is read and then
/// replaced by the hint for the next query of this pair in this order.
///
/// Of solids with several parts it is the least over the pairs of parts, the polynomial of a union
/// being the least of those of its parts: one part of `a` and the part of `b` where it is lowest,
/// to which witness, multiplier and `saturated` belong.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Options, Pose, WarmStart, level_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let d = level_distance(&ball, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((d.value() - 4.0).abs() < 1e-8); // |x|² is 4 at (2, 0, 0)
/// assert!((d.gradient_b.linear - Vector3::new(4.0, 0.0, 0.0)).norm() < 1e-6); // and its slope there 4
///
/// let pair = Compound::new("pair", vec![ball.clone(), Body::ball("far", Vector3::new(0.0, 5.0, 0.0), 1.0)?])?;
/// let e = level_distance(&pair, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((e.value() - d.value()).abs() < 1e-8 && !e.tied);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn level_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    match (a.parts(), b.parts()) {
        ([a], [b]) => between((a, pose_a), (b, pose_b), options, warm),
        (a, b) => lowest((a, pose_a), (b, pose_b), options, warm),
    }
}

fn lowest(
    (a, pose_a): At<'_, [Body]>,
    (b, pose_b): At<'_, [Body]>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    let bound = |(i, j): (usize, usize)| level_bound((&a[i], pose_a), (&b[j], pose_b));
    let found = least((a.len(), b.len()), bound, f64::NEG_INFINITY, warm, |(i, j), _, hint| {
        between((&a[i], pose_a), (&b[j], pose_b), options, hint)
    });
    let narrow = found.best.upper - found.lower <= options.accuracy() * found.best.upper.abs().max(1.0);
    let (lower, tied, iterations) = (found.lower, found.tied, found.iterations);
    LevelDistance { status: Status::of(narrow), lower, tied, iterations, ..found.best }
}

/// Lower bound of the level distance from B's circumscribed ball: along a ray from the interior
/// point c a convex p with p(c) < 1 that is 1 within the reach R is at least `p(c) + (1 - p(c)) r /
/// R` at r >= R.
pub(super) fn level_bound((a, pose_a): At<'_, Body>, (b, pose_b): At<'_, Body>) -> f64 {
    let (own, other) = (a.circumscribed(), b.circumscribed());
    let (_, apart, error) = across((pose_a, a.interior_point()), (pose_b, &other.center));
    let reach = (a.interior_point() - own.center).norm() + own.radius;
    let times = ((apart - error - other.radius) / reach - CULLING_SLACK * (apart + other.radius) / reach)
        * (1.0 - CULLING_SLACK);
    let least = a.min_value();
    if times > 1.0 { least + (1.0 - least) * times - CULLING_SLACK * times } else { f64::NEG_INFINITY }
}
