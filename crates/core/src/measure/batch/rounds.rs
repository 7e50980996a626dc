//! The rounds that the poses of a batch go through.

use crate::body::Body;
use crate::measure::distance::{Distance, distance};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::warm::WarmStart;
use crate::polynomial::{Singles, Twice};

/// The numbers of the first rounds, unless there are few poses: while one vector waits for its
/// operands the other is computed with.
pub(super) type Coarse<S> = Twice<Singles<S>>;

/// Rounds in single precision that every pose goes through.
pub(super) const COARSE: u32 = 2;

/// Most of them.
pub(super) const MOST_COARSE: u32 = 6;

/// Square of the last step relative to the longest one allowed, dimensionless, below which the next
/// step, in double precision, is likely to end with a narrow bracket: a hundredth of a move leaves
/// about its square.
///
/// A larger value makes brackets before they are narrow, a smaller one takes a round more in single
/// precision. It changes time only; no test pins it.
pub(super) const NEARLY_CONVERGED: f64 = 1e-4;

/// The same, dimensionless, above which Newton's method has diverged after [`MOST_COARSE`] rounds:
/// a fifth of the longest move, as long as in a search from a cold start then.
///
/// A smaller value solves poses alone that would have converged, a larger one keeps poses in lanes
/// that never do: `lanes_answer_alike_in_any_unit` counts them.
pub(super) const DIVERGED: f64 = 0.04;

/// Most rounds of a pose before it is solved alone.
pub(super) const MOST_ROUNDS: u32 = 8;

/// The answer to a pose by a query for it alone, after rounds that it has gone through in lanes.
pub(super) fn solve_alone(
    (a, pose_a): (&Body, &Pose),
    (b, pose_b): (&Body, &Pose),
    (options, rounds): (&Options<'_>, u32),
    mut warm: WarmStart,
) -> Distance {
    let found = distance(a, pose_a, b, pose_b, &options.after(rounds), &mut warm);
    Distance { iterations: found.iterations + rounds, ..found }
}
