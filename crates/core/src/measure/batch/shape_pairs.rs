//! Two boxes or cylinders, or one of them and the axis of a capsule, at several poses at once:
//! rounds of a bracket and a step.

use super::lane_poses::{lane_rotations, lane_translations};
use super::rounds::MOST_ROUNDS;
use super::shapes::{OfBodies, ShapeAnswers, load, store, write};
use super::waiting::{Group, Waiting};
use crate::body::{ClosedForm, ExactShape};
use crate::measure::distance::Distance;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::quaternion::{conjugate_times, rotation_by};
use crate::measure::frames::vector::apply_transposed;
use crate::measure::solver::exact_shape::{
    Cuboid, Cylinder, ExactProven, LaneLeast, LanePair, LaneSet, Segment, active, direction_to_world, to_world,
};
use crate::measure::status::Status;
use crate::polynomial::{Lanes, MAX_LANES, Simd, Vector, WithSimd, dispatch_lanes};

/// A shape whose axes are those of its frame, and its poses: one for each answer, or a single one
/// for all.
pub(super) type Placed<'a> = (&'a ClosedForm, &'a [Pose]);

/// Distances of two bodies with these forms.
pub(super) fn distances(bodies: OfBodies<'_>, [form_a, form_b]: [&ClosedForm; 2]) {
    use ExactShape::{Cuboid as Block, Cylinder as Rod};
    let (of_a, of_b) = ((form_a, std::slice::from_ref(bodies.a.1)), (form_b, bodies.b.1));
    // The least over a box is found exactly, step by step.
    let swapped = matches!((form_a.shape(), form_b.shape()), (Rod { .. }, Block { .. }));
    let (first, second) = if swapped { (of_b, of_a) } else { (of_a, of_b) };
    let tolerance = bodies.tolerance;
    let answers = OfShapes { bodies, forms: [first.0, second.0], swapped };
    let block = |half_extents| Cuboid { half_extents };
    let rod = |radius, half_height| Cylinder { radius, half_height };
    match (*first.0.shape(), *second.0.shape()) {
        (Block { half_extents_m: a, .. }, Block { half_extents_m: b, .. }) => {
            solve((first, block(a)), (second, block(b)), tolerance, answers);
        }
        (Block { half_extents_m: a, .. }, Rod { radius_m, half_height_m, .. }) => {
            solve((first, block(a)), (second, rod(radius_m, half_height_m)), tolerance, answers);
        }
        (Rod { radius_m: r, half_height_m: h, .. }, Rod { radius_m, half_height_m, .. }) => {
            solve((first, rod(r, h)), (second, rod(radius_m, half_height_m)), tolerance, answers);
        }
        _ => solve_alone(answers),
    }
}

/// Distances of a shape from axes of this half length, metres.
pub(super) fn distances_of_axes(
    shape: Placed<'_>,
    (axis, half_length): (Placed<'_>, f64),
    tolerance: f64,
    answers: impl ShapeAnswers,
) {
    let axis = (axis, Segment { half_length });
    match *shape.0.shape() {
        ExactShape::Cuboid { half_extents_m, .. } => {
            solve((shape, Cuboid { half_extents: half_extents_m }), axis, tolerance, answers);
        }
        ExactShape::Cylinder { radius_m, half_height_m, .. } => {
            solve((shape, Cylinder { radius: radius_m, half_height: half_height_m }), axis, tolerance, answers);
        }
        ExactShape::Capsule { .. } => solve_alone(answers),
    }
}

fn solve(
    (first, a): (Placed<'_>, impl LaneLeast),
    (second, b): (Placed<'_>, impl LaneSet),
    tolerance: f64,
    answers: impl ShapeAnswers,
) {
    dispatch_lanes(PairBatch { first, second, sets: (a, b), tolerance, answers });
}

fn solve_alone(mut answers: impl ShapeAnswers) {
    for answer in 0..answers.count() {
        answers.solve_alone(answer, 0);
    }
}

/// A batch of two shapes as work for the widest arithmetic.
struct PairBatch<'a, A, B, W> {
    /// Whose points are searched.
    first: Placed<'a>,
    second: Placed<'a>,
    sets: (A, B),
    /// Width of the bracket that is narrow enough, metres.
    tolerance: f64,
    answers: W,
}

impl<A: LaneLeast, B: LaneSet, W: ShapeAnswers> WithSimd for PairBatch<'_, A, B, W> {
    type Output = ();

    /// Poses that need another round wait until there is a group of them.
    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let (count, lanes) = (self.answers.count(), Lanes::<S>::COUNT);
        let mut waiting = Waiting::none();
        let mut next = 0;
        while !self.answers.is_stopped() {
            let fresh = waiting.len < lanes && next < count;
            if !fresh && waiting.len == 0 {
                return;
            }
            let group = if fresh { Group::fresh(next..count.min(next + lanes)) } else { waiting.take(lanes) };
            next += if fresh { group.count } else { 0 };
            self.round(simd, group, fresh, &mut waiting);
        }
        for (pose, rounds) in waiting.pose.iter().zip(&waiting.rounds).take(waiting.len) {
            self.answers.solve_alone(*pose, *rounds);
        }
        for pose in next..count {
            self.answers.solve_alone(pose, 0);
        }
    }
}

impl<A: LaneLeast, B: LaneSet, W: ShapeAnswers> PairBatch<'_, A, B, W> {
    /// A bracket of each pose of a group: writes the answers, and takes a step and lets the other
    /// poses wait.
    #[inline(always)]
    fn round<S: Simd>(&mut self, simd: S, mut group: Group<MAX_LANES>, fresh: bool, waiting: &mut Waiting) {
        let pair = self.pair(simd, &group.pose);
        let own = if fresh { pair.start(simd) } else { load(simd, &group) };
        let (view, brackets, proven) = pair.bracket(simd, own, self.tolerance);
        let all = (1 << group.count) - 1;
        let proven = Lanes::<S>::bits(simd, proven) & all;
        if proven != 0 {
            write(&mut self.answers, &group, proven, &brackets);
        }
        if proven == all {
            return;
        }
        let (next, open) = pair.step(simd, &view, self.tolerance);
        let open = Lanes::<S>::bits(simd, open);
        store(next, &mut group);
        for lane in (0..group.count).filter(|lane| proven >> lane & 1 == 0) {
            group.rounds[lane] += 1;
            if open >> lane & 1 == 1 && group.rounds[lane] < MOST_ROUNDS {
                waiting.push(&group, lane);
            } else {
                self.solve_alone(group.pose[lane], group.rounds[lane]);
            }
        }
    }

    #[inline(never)]
    fn solve_alone(&mut self, pose: usize, rounds: u32) {
        self.answers.solve_alone(pose, rounds);
    }

    /// The first shape as seen from the second one.
    #[inline(always)]
    fn pair<S: Simd>(&self, simd: S, poses: &[usize; MAX_LANES]) -> LanePair<A, B, Lanes<S>> {
        let ((form_a, of_a), (form_b, of_b)) = (self.first, self.second);
        let home = lane_rotations(simd, of_b, poses);
        let away = lane_rotations(simd, of_a, poses);
        let t = lane_translations(simd, of_a, of_b, poses);
        let rotation = rotation_by(simd, conjugate_times(home, away));
        let translation = apply_transposed(&rotation_by(simd, home), t);
        let (a, b) = self.sets;
        let displacement = form_a.displacement_m() + form_b.displacement_m();
        let (a, b) = ((a, form_a.center()), (b, form_b.center()));
        LanePair::from_parts(simd, a, b, (rotation, translation), displacement)
    }
}

/// Distances of two bodies with closed forms.
struct OfShapes<'a> {
    bodies: OfBodies<'a>,
    /// Of the first shape of the batch and of the second one.
    forms: [&'a ClosedForm; 2],
    /// Whether the first shape is that of the second body.
    swapped: bool,
}

impl ShapeAnswers for OfShapes<'_> {
    fn count(&self) -> usize {
        self.bodies.count()
    }

    fn is_stopped(&self) -> bool {
        self.bodies.is_stopped()
    }

    fn write(&mut self, answer: usize, found: &ExactProven) {
        let ([first, second], (pose_a, pose_b)) = (self.forms, (self.bodies.a.1, &self.bodies.b.1[answer]));
        let (first_pose, second_pose) = if self.swapped { (pose_b, pose_a) } else { (pose_a, pose_b) };
        let ExactProven { lower, upper, x, nearest, n, rounds, .. } = *found;
        let [x, y] = [x, nearest].map(|point| to_world(second, second_pose, point));
        let normal = direction_to_world(second, second_pose, n);
        let own = first_pose.rotation().inverse_transform_vector(&-normal);
        let (of_first, of_second) = (active(first.shape(), own.into()), active(second.shape(), n));
        let ((witness_a, active_a), (witness_b, active_b), normal) = if self.swapped {
            ((y, of_second), (x, of_first), -normal)
        } else {
            ((x, of_first), (y, of_second), normal)
        };
        self.bodies.answers[answer] = Distance {
            status: Status::Converged,
            lower,
            upper,
            witness_a,
            witness_b,
            normal: Some(normal),
            active_a,
            active_b,
            parts: [0, 0],
            tied: false,
            iterations: rounds,
        };
    }

    fn solve_alone(&mut self, answer: usize, rounds: u32) {
        self.bodies.solve_alone(answer, rounds);
    }
}

#[cfg(test)]
mod tests;
