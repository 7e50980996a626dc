//! Support points of bodies of any number of constraints: the convex program over one body, with a
//! bracket of the height after every step that is short enough.

use crate::measure::bounds::duality_bounds::{DUALITY_ROUNDING, descent};
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::projection::{Objective, SingleProblem, Start, Worth, solve_single};
use nalgebra::Vector3;

/// A point within whose displacement a point of the body lies, with the constraints that are active
/// at it; query frame.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct SupportPoint {
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) active: ActiveSet,
}

impl SupportPoint {
    /// A point where one constraint is active.
    pub(super) fn at((x, active): (Vector3<f64>, usize)) -> Self {
        Self { x, active: 1 << active }
    }
}

/// Which point of a body is farthest along a direction, query frame.
#[derive(Clone, Copy)]
pub(super) struct SupportProgram<'a> {
    pub(super) body: &'a Posed<'a>,
    /// The direction r, of length 1 up to rounding.
    pub(super) direction: Vector3<f64>,
    /// Where to begin, and what may be active there; nothing where its active set is empty.
    pub(super) start: SupportPoint,
    /// Where to begin again if that leads nowhere.
    pub(super) other: Option<SupportPoint>,
}

/// Width of a bracket, query units, that is not far from what rounding leaves of any: more is
/// asked of a few steps more, and not of the interior-point method.
///
/// Larger, heights of flat sides stay wide that could be narrow; smaller, tighter accuracies cost
/// an interior-point method for each direction. It changes time only below the rounding floor of
/// `Options::with_accuracy`.
const FLOOR: f64 = 64.0 * DUALITY_ROUNDING;

/// Bracket of `max r·v` over the points v of a body; query units.
#[derive(Clone, Copy, Debug)]
pub(super) struct Supported {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) point: SupportPoint,
    pub(super) iterations: u32,
}

impl SupportProgram<'_> {
    /// Brackets the height to `narrow` query units if possible, or until `exhausted` says so after
    /// a number of iterations. The point is the best one that is proven inside; where there is none
    /// the lower bound is minus infinity.
    pub(super) fn solve(&self, narrow: f64, exhausted: impl FnMut(u32) -> bool) -> Supported {
        let Self { body, direction: r, start, other } = *self;
        let (mut lower, mut upper) = (f64::NEG_INFINITY, r.dot(&body.interior) + body.reach(&body.interior));
        let mut point = body.interior;
        let objective = Objective::Farthest(r);
        let begin = |from: SupportPoint| Start { y: from.x, active: from.active };
        let (start, other) = (begin(start), other.map(begin));
        let problem = SingleProblem { body, objective: &objective, start, other, narrow };
        let (iterations, active) = solve_single(&problem, exhausted, |trial| {
            let multipliers = trial.multipliers.map(|m| m.max(0.0));
            let rise = descent(body, &trial.y, &-r, &multipliers);
            let slack = DUALITY_ROUNDING * (trial.y.norm() + rise.abs());
            let bound = r.dot(&trial.y) + rise + body.displacement(&trial.y) + slack;
            // Not `min`: a NaN bounds nothing.
            if bound < upper {
                upper = bound;
            }
            if let Some(y) = body.move_inside(&trial.y) {
                let attained = r.dot(&y) - body.displacement(&y);
                if attained > lower {
                    (lower, point) = (attained, y);
                }
            }
            match upper - lower {
                width if width <= narrow => Worth::Done,
                width if width <= FLOOR => Worth::Narrow,
                _ => Worth::Wide,
            }
        });
        Supported { lower, upper, point: SupportPoint { x: point, active }, iterations }
    }

    /// A point of the body within `tolerance` of the farthest, query units, if possible; none if
    /// rounding leaves none that is proven inside.
    fn point(&self, tolerance: f64) -> Option<SupportPoint> {
        let found = self.solve(tolerance, |_| false);
        let is_found = found.lower > f64::NEG_INFINITY;
        if is_found && found.upper - found.lower <= tolerance.max(FLOOR) {
            return Some(found.point);
        }
        // On surfaces that are flat at all scales the search may end early, and what was known may
        // be better.
        let inside = |from: SupportPoint| self.body.move_inside(&from.x).map(|x| SupportPoint { x, ..from });
        let known = [Some(self.start), self.other].into_iter().flatten().filter_map(inside);
        let along = |point: &SupportPoint| self.direction.dot(&point.x);
        let all = known.chain(is_found.then_some(found.point)).filter(|point| along(point).is_finite());
        all.max_by(|p, q| along(p).total_cmp(&along(q)))
    }
}

/// A point of A within `tolerance` of the farthest along the unit vector n, query units, if
/// possible, from a point known before or the table; none if rounding leaves none inside.
pub(in crate::measure) fn support_of_a(
    pair: &Pair<'_>,
    n: &Vector3<f64>,
    tolerance: f64,
    known: Option<SupportPoint>,
) -> Option<SupportPoint> {
    support(&pair.a, n, tolerance, known, SupportPoint::at(pair.farthest_a(n)))
}

/// The same of B.
pub(in crate::measure) fn support_of_b(
    pair: &Pair<'_>,
    n: &Vector3<f64>,
    tolerance: f64,
    known: Option<SupportPoint>,
) -> Option<SupportPoint> {
    support(&pair.b, n, tolerance, known, SupportPoint::at(pair.farthest_b(n)))
}

fn support(
    body: &Posed<'_>,
    n: &Vector3<f64>,
    tolerance: f64,
    known: Option<SupportPoint>,
    of_table: SupportPoint,
) -> Option<SupportPoint> {
    let (start, other) = (known.unwrap_or(of_table), known.map(|_| of_table));
    SupportProgram { body, direction: *n, start, other }.point(tolerance)
}
