//! The signed distance of a solid from a half-space, until it is known or says what is asked.

use super::answer::HalfSpaceDistance;
use super::set::HalfSpace;
use crate::body::{Ball, Body, Solid};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::{At, Least, nearest_part};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::support_point::{Asked, Height, SupportPoint, height};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// The signed distance, as soon as its bracket is narrow or meets the goal.
pub(super) fn distance_until(
    (solid, pose): At<'_, impl Solid>,
    half_space: &HalfSpace,
    goal: StopCriterion,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> HalfSpaceDistance {
    let tolerance = options.accuracy() * solid.circumscribed().radius;
    let ask = Ask { half_space, tolerance, goal, options };
    let parts = solid.parts();
    if let [body] = parts {
        return ask.of_body((body, pose), warm);
    }
    let (normal, place) = (half_space.normal(), pose.translation());
    let bound = |ball: &Ball| {
        let center = pose.transform_point(&ball.center);
        let size = place.norm() + ball.center.norm() + half_space.offset().abs() + ball.radius;
        normal.dot(&center) - half_space.offset() - ball.radius - (ROTATION_ERROR + gamma(16)) * size
    };
    let found = nearest_part(solid, bound, &goal, warm, |i, _, hint| ask.of_body((&parts[i], pose), hint));
    let Least { best, lower, tied, iterations, .. } = found;
    HalfSpaceDistance { status: Status::of(best.upper - lower <= tolerance), lower, tied, iterations, ..best }
}

/// What is asked of each part.
#[derive(Clone, Copy)]
struct Ask<'a> {
    half_space: &'a HalfSpace,
    /// Width of the bracket asked for, metres.
    tolerance: f64,
    goal: StopCriterion,
    options: &'a Options<'a>,
}

impl Ask<'_> {
    fn of_body(&self, (body, pose): At<'_, Body>, warm: &mut WarmStart) -> HalfSpaceDistance {
        let Self { half_space, tolerance, goal, options } = *self;
        let above = Above::new((body, pose), half_space);
        let known = match warm.hint {
            Hint::Single { y, active } => Some(SupportPoint { x: y, active }),
            _ => None,
        };
        let answer = |[lower, upper]: [f64; 2], point: &Vector3<f64>, iterations| HalfSpaceDistance {
            status: Status::of(upper - lower <= tolerance),
            lower,
            upper,
            witness: pose.transform_point(point),
            tied: false,
            iterations,
        };
        let mut spent = 0;
        let mut start = known;
        let mut proven = [f64::NEG_INFINITY, f64::INFINITY];
        if !goal.is_narrow() && body.closed_form().is_none() {
            // Balls around and inside, then the table of heights.
            let (outer, inner) = (body.circumscribed(), body.growth_ball());
            proven = [above.of(&outer.center, outer.radius)[0], above.of(&inner.center, inner.radius)[1]];
            if !goal.met(proven[0], proven[1]) {
                proven[0] = proven[0].max(above.of(body.interior_point(), body.height(&above.down))[0]);
            }
            if goal.met(proven[0], proven[1]) {
                return answer(proven, &inner.center, 0);
            }
            // One evaluation from the table of support points is about as accurate.
            let asked = Asked::within(1e-2 * outer.radius);
            let rough = height(body, &above.down, asked, known, options);
            proven = both(proven, above.bracket(&rough));
            if goal.met(proven[0], proven[1]) {
                warm.hint = Hint::Single { y: rough.point, active: rough.active };
                return answer(proven, &rough.point, rough.iterations);
            }
            (start, spent) = (Some(SupportPoint { x: rough.point, active: rough.active }), rough.iterations);
        }
        // The other half is left to roundings: of the surface, and of where the body stands.
        let found = height(body, &above.down, Asked::narrow(0.5 * tolerance), start, &options.after(spent));
        warm.hint = Hint::Single { y: found.point, active: found.active };
        answer(both(proven, above.bracket(&found)), &found.point, spent + found.iterations)
    }
}

/// What two brackets of one number prove together.
fn both([least, most]: [f64; 2], [lower, upper]: [f64; 2]) -> [f64; 2] {
    [least.max(lower), most.min(upper)]
}

/// Heights above the plane, of points of one body where it stands.
struct Above<'a> {
    body: &'a Body,
    pose: &'a Pose,
    half_space: &'a HalfSpace,
    /// The direction into the half-space, body frame.
    down: Vector3<f64>,
}

impl<'a> Above<'a> {
    fn new((body, pose): At<'a, Body>, half_space: &'a HalfSpace) -> Self {
        let down = pose.rotation().inverse_transform_vector(&-half_space.normal());
        Self { body, pose, half_space, down }
    }

    /// Height of a point of the body frame and a bound of its error, with that of directions for
    /// points within the circumscribed ball; metres.
    fn point(&self, x: &Vector3<f64>) -> (f64, f64) {
        let Self { body, pose, half_space, .. } = self;
        let (normal, offset) = (half_space.normal(), half_space.offset());
        // n·R x + n·t.
        let height = normal.dot(&pose.transform_direction(x)) + normal.dot(pose.translation()) - offset;
        let ball = body.circumscribed();
        let reach = ball.radius + (ball.center - x).norm();
        let size = x.norm() + pose.translation().norm() + offset.abs() + reach;
        (height, (ROTATION_ERROR + gamma(16)) * size)
    }

    /// Bracket of the height of the lowest point of a set that reaches down so far from a point.
    fn of(&self, x: &Vector3<f64>, reach: f64) -> [f64; 2] {
        let (height, error) = self.point(x);
        [height - reach - error, height - reach + error]
    }

    /// Bracket of the height of the lowest point of the body.
    fn bracket(&self, found: &Height) -> [f64; 2] {
        let (height, error) = self.point(&self.body.normalization().center);
        [height - found.upper - error, height - found.lower + error]
    }
}
