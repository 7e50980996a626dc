//! The rounds that the poses of a batch go through.

use super::waiting::{Group, MAX_COARSE, Waiting};
use crate::body::Body;
use crate::measure::distance::{Distance, distance};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::warm::WarmStart;
use crate::polynomial::{Lanes, MAX_LANES, Simd, Singles, Twice, Vector};

/// The numbers of the first rounds, unless there are few poses: while one vector waits for its
/// operands the other is computed with.
type Coarse<S> = Twice<Singles<S>>;

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

/// A batch whose poses go through rounds. Each answer is written once: by the lanes, or by a query
/// for the pose alone.
pub(super) trait Rounds {
    /// Number of poses.
    fn poses(&self) -> usize;

    /// Whether to end with what is known.
    fn is_stopped(&self) -> bool;

    /// Rounds in single precision, after which the poses wait for what is next; fresh ones are
    /// started first.
    fn approach<S: Simd, N: Vector<S>>(
        &mut self,
        simd: S,
        group: Group<MAX_COARSE>,
        fresh: bool,
        far: &mut Waiting,
        near: &mut Waiting,
    );

    /// One round of a group that proves: writes the answers and lets the other poses wait.
    fn prove<S: Simd>(&mut self, simd: S, group: Group<MAX_LANES>, waiting: &mut Waiting);

    /// Answers a pose by a query for it alone, after the rounds that it has gone through in lanes.
    fn solve_alone(&mut self, pose: usize, rounds: u32, warm: WarmStart);
}

/// Takes all poses through their rounds.
#[inline(always)]
pub(super) fn run<S: Simd>(simd: S, batch: &mut impl Rounds) {
    let (lanes, singles) = (Lanes::<S>::COUNT, Coarse::<S>::COUNT);
    let (mut far, mut near) = (Waiting::none(), Waiting::none());
    let mut next = 0;
    while !batch.is_stopped() {
        let left = batch.poses() - next;
        if near.len >= lanes || near.len > 0 && far.len + left == 0 {
            let group = near.take(lanes);
            batch.prove(simd, group, &mut near);
        } else if far.len + left > 0 {
            let fresh = far.len < singles && left > 0;
            let group = if fresh { Group::fresh(next..next + left.min(singles)) } else { far.take(singles) };
            next += if fresh { group.count } else { 0 };
            if group.count > Singles::<S>::COUNT {
                batch.approach::<S, Coarse<S>>(simd, group, fresh, &mut far, &mut near);
            } else {
                batch.approach::<S, Singles<S>>(simd, group, fresh, &mut far, &mut near);
            }
        } else {
            return;
        }
    }
    // Stopped: what is known by now of the poses that are left is the answer.
    for waiting in [&far, &near] {
        for (pose, rounds) in waiting.pose.iter().zip(&waiting.rounds).take(waiting.len) {
            batch.solve_alone(*pose, *rounds, WarmStart::default());
        }
    }
    for pose in next..batch.poses() {
        batch.solve_alone(pose, 0, WarmStart::default());
    }
}

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
