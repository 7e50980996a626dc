//! Solids with several parts: measures of unions from those of pairs of convex parts.
//!
//! Distance, level distance and growth distance of unions are the least of those of the pairs of
//! parts ([`pairwise_minimum`]). How deep unions overlap is another matter ([`depth`]): a
//! translation has to take all pairs apart at once. Each function hands two single bodies straight
//! on.

mod depth;
mod min_norm_point;
mod pairwise_minimum;
mod separating_translation;
#[cfg(test)]
mod tests;

use crate::body::{Body, Solid};
use crate::measure::Status;
use crate::measure::distance::Distance;
use crate::measure::frames::pose::Pose;
use crate::measure::growth::{self, GrowthDistance};
use crate::measure::level::{self, LevelDistance};
use crate::measure::options::Options;
use crate::measure::overlap::{Goal, across, ball_gap, settle};
use crate::measure::warm::WarmStart;
pub(super) use depth::{penetration, signed_distance};
pub(super) use pairwise_minimum::{Least, least};

/// A part or a solid with its pose.
type At<'a, T> = (&'a T, &'a Pose);

/// Distance of two solids, or as much of it as the goal needs.
#[inline]
pub(super) fn distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    goal: &Goal,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    if let ([a], [b]) = (a.parts(), b.parts()) {
        return settle((a, pose_a), (b, pose_b), goal, options, warm);
    }
    let radius = a.circumscribed().radius.min(b.circumscribed().radius);
    let mut found = closest((a.parts(), pose_a), (b.parts(), pose_b), goal, options, warm);
    found.status = status(found.upper - found.lower <= options.accuracy() * radius);
    found
}

fn closest(
    (a, pose_a): At<'_, [Body]>,
    (b, pose_b): At<'_, [Body]>,
    goal: &Goal,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    let gap = |(i, j): (usize, usize)| ball_gap((&a[i], pose_a), (&b[j], pose_b));
    let found = least((a.len(), b.len()), gap, goal.near.max(0.0), warm, |(i, j), nearest, hint| {
        let goal = Goal { near: goal.near, far: goal.far.min(nearest) };
        settle((&a[i], pose_a), (&b[j], pose_b), &goal, options, hint)
    });
    let tied = found.tied && found.best.normal.is_some();
    let parts = warm.parts.into();
    Distance { lower: found.lower, parts, tied, iterations: found.iterations, ..found.best }
}

/// Level distance of one solid over another.
#[inline]
pub(super) fn level_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    match (a.parts(), b.parts()) {
        ([a], [b]) => level::between(a, pose_a, b, pose_b, options, warm),
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
        level::between(&a[i], pose_a, &b[j], pose_b, options, hint)
    });
    let narrow = found.best.upper - found.lower <= options.accuracy() * found.best.upper.abs().max(1.0);
    let (lower, tied, iterations) = (found.lower, found.tied, found.iterations);
    LevelDistance { status: status(narrow), lower, tied, iterations, ..found.best }
}

/// Lower bound of the level distance from B's circumscribed ball: along a ray from the interior
/// point c a convex p with p(c) < 1 that is 1 within the reach R is at least `p(c) + (1 - p(c)) r /
/// R` at r >= R.
fn level_bound((a, pose_a): At<'_, Body>, (b, pose_b): At<'_, Body>) -> f64 {
    let (own, other) = (a.circumscribed(), b.circumscribed());
    let (_, apart, error) = across((pose_a, a.interior_point()), (pose_b, &other.center));
    let reach = (a.interior_point() - own.center).norm() + own.radius;
    let times = ((apart - error - other.radius) / reach - CARE * (apart + other.radius) / reach) * (1.0 - CARE);
    let least = a.min_value();
    if times > 1.0 { least + (1.0 - least) * times - CARE * times } else { f64::NEG_INFINITY }
}

/// Relative slack of cheap bounds, many times their rounding.
const CARE: f64 = 1e-14;

/// Growth distance of two solids.
#[inline]
pub(super) fn growth_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    match (a.parts(), b.parts()) {
        ([a], [b]) => growth::between(a, pose_a, b, pose_b, options, warm),
        (a, b) => first_to_touch((a, pose_a), (b, pose_b), options, warm),
    }
}

fn first_to_touch(
    (a, pose_a): At<'_, [Body]>,
    (b, pose_b): At<'_, [Body]>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    let bound = |(i, j): (usize, usize)| growth_bound((&a[i], pose_a), (&b[j], pose_b));
    let found = least((a.len(), b.len()), bound, f64::NEG_INFINITY, warm, |(i, j), _, hint| {
        growth::between(&a[i], pose_a, &b[j], pose_b, options, hint)
    });
    let narrow = found.best.upper - found.lower <= options.accuracy() * found.best.upper.max(1.0);
    let (lower, tied, iterations) = (found.lower, found.tied, found.iterations);
    GrowthDistance { status: status(narrow), lower, tied, iterations, ..found.best }
}

/// Lower bound of the growth distance from balls about the centres: the distance of these over the
/// sum of their radii.
fn growth_bound((a, pose_a): At<'_, Body>, (b, pose_b): At<'_, Body>) -> f64 {
    let reach = |body: &Body| {
        let (center, ball) = (body.growth_ball().center, body.circumscribed());
        (center - ball.center).norm() + ball.radius
    };
    let (_, apart, error) = across((pose_a, &a.growth_ball().center), (pose_b, &b.growth_ball().center));
    (apart - error) / (reach(a) + reach(b)) * (1.0 - CARE)
}

/// How a solve ended, by whether its bracket is as narrow as asked for.
pub(super) fn status(narrow: bool) -> Status {
    if narrow { Status::Converged } else { Status::BracketWide }
}
