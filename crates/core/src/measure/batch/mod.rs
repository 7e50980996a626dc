//! Distances of one pair at many poses at once, a pose in each lane of the vectors.
//!
//! All poses are solved cold: the start of [`crate::measure::start`], then rounds of evaluation and
//! step until the bracket is narrow. The first rounds, which are far off in any precision, are of
//! single precision, for more poses at a time. Those that bracket are of double; the poses that
//! need more than one wait until there is a group of them, so that the slowest does not delay the
//! others. A lane computes from its own pose only and selects where a single query would branch, so
//! that no answer depends on the other poses of the batch.

mod balls;
mod capsules;
mod error;
mod iterate;
mod lane_poses;
mod rounds;
mod shape_pairs;
mod shapes;
mod waiting;

use crate::body::{Body, ClosedForm, ExactShape, Solid};
use crate::measure::distance::{Distance, distance};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::quaternion::{conjugate_times, rotation_by, splat_quaternion};
use crate::measure::frames::vector::{V3, add, apply, apply_transposed, dot, rows, subtract};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::continuation::{limits, worth_a_bracket};
use crate::measure::solver::exact_shape::{Cuboid, Cylinder, LaneSet, Segment};
use crate::measure::solver::initial_guess::{Start, facing, meeting, middle};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::tangent_newton::{ALIGNED, Relative, Side, bracket, moved};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::{Aligned, Lanes, MAX_LANES, Number, Simd, Vector, WithSimd, dispatch_lanes};
use balls::BallBatch;
pub use capsules::{distance_to_capsule_batch, is_capsule_solved_in_lanes};
pub use error::BatchError;
use iterate::Iterate;
use lane_poses::{lane_rotations, lane_translations};
use nalgebra::Vector3;
use rounds::{COARSE, DIVERGED, MOST_COARSE, MOST_ROUNDS, NEARLY_CONVERGED, Rounds, run, solve_alone};
use shape_pairs::distances;
use shapes::{OfBodies, ShapeBatch};
use waiting::{Group, MAX_COARSE, Waiting};

/// Euclidean distances between solid `a` at `pose_a` and solid `b` at each of `poses_b` (body to
/// world), written to `answers` in the order of the poses.
///
/// Each answer is one of [`distance`] from a cold start in all that is proven of it, and depends on
/// its own pose only, to the last bit. Single bodies of one constraint, and boxes and cylinders
/// along the axes of their frames, are solved several poses at a time, which takes a fraction of
/// the time of as many queries, of balls by the projection of their centres; all others, and poses
/// that do not converge at once such as those in contact, are solved one by one.
///
/// # Errors
/// No poses, or a number of places that is not the number of poses; nothing is computed then.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Distance, Options, Pose, distance_batch};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 0.8, 0.6))?;
/// let along = |x: f64| Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]);
/// let poses = [along(2.0)?, along(3.0)?, along(4.0)?];
/// let mut answers = [Distance::default(); 3];
/// distance_batch(&egg, &Pose::identity(), &ball, &poses, &Options::default(), &mut answers)?;
/// for (answer, gap) in answers.iter().zip([0.5, 1.5, 2.5]) {
///     assert!((answer.value() - gap).abs() < 1e-8);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_batch(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    poses_b: &[Pose],
    options: &Options<'_>,
    answers: &mut [Distance],
) -> Result<(), BatchError> {
    if poses_b.len() != answers.len() {
        return Err(BatchError::Lengths { poses: poses_b.len(), answers: answers.len() });
    }
    if poses_b.is_empty() {
        return Err(BatchError::Empty);
    }
    if let ([a], [b]) = (a.parts(), b.parts())
        && let Some(method) = LaneMethod::of(a, b)
        && options.max_iterations() >= MOST_ROUNDS
        && runs(Stage::Lanes)
    {
        in_lanes(method, (a, pose_a), (b, poses_b), options, answers);
    } else {
        for (answer, pose_b) in answers.iter_mut().zip(poses_b) {
            *answer = distance(a, pose_a, b, pose_b, options, &mut WarmStart::default());
        }
    }
    Ok(())
}

/// Whether [`distance_batch`] solves several poses of these solids at a time.
pub fn is_solved_in_lanes(a: &impl Solid, b: &impl Solid) -> bool {
    matches!((a.parts(), b.parts()), ([a], [b]) if LaneMethod::of(a, b).is_some())
}

/// How several poses of two bodies are solved at a time.
#[derive(Clone, Copy)]
enum LaneMethod<'a> {
    /// Both have one constraint.
    Smooth,
    /// One has one constraint, the other is such a shape; of two balls the second.
    Beside(&'a ClosedForm, LaneShape),
    /// Both are boxes or cylinders.
    Shapes([&'a ClosedForm; 2]),
}

/// What a body with one constraint is beside.
#[derive(Clone, Copy)]
enum LaneShape {
    /// A ball, beside another one, of this radius, metres.
    Ball(f64),
    Cuboid(Cuboid),
    Cylinder(Cylinder),
}

impl<'a> LaneMethod<'a> {
    fn of(a: &'a Body, b: &'a Body) -> Option<Self> {
        let form = |body: &'a Body| body.closed_form().filter(|form| form.axes().is_none());
        let other = match (a.is_smooth(), b.is_smooth()) {
            (true, true) if runs(Stage::ClosedForm) && ball_radius_m(a).is_some() && ball_radius_m(b).is_some() => b,
            (true, true) => return Some(Self::Smooth),
            (true, false) => b,
            (false, true) => a,
            (false, false) => return Some(Self::Shapes([form(a)?, form(b)?])),
        };
        let form = form(other)?;
        let shape = match *form.shape() {
            ExactShape::Cuboid { half_extents_m, .. } => LaneShape::Cuboid(Cuboid { half_extents: half_extents_m }),
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                LaneShape::Cylinder(Cylinder { radius: radius_m, half_height: half_height_m })
            }
            ExactShape::Capsule { radius_m, .. } => LaneShape::Ball(radius_m),
        };
        Some(Self::Beside(form, shape))
    }
}

/// Radius of a body that is a ball, metres.
fn ball_radius_m(body: &Body) -> Option<f64> {
    body.closed_form()?.shape().ball_radius_m()
}

/// The answers of single bodies. Not generic, so that it is compiled with this crate, whatever its
/// callers are compiled for.
fn in_lanes(
    method: LaneMethod<'_>,
    of_a: (&Body, &Pose),
    of_b: (&Body, &[Pose]),
    options: &Options<'_>,
    answers: &mut [Distance],
) {
    let ((a, pose_a), (b, poses_b)) = (of_a, of_b);
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    let standing = std::slice::from_ref(pose_a);
    let of_bodies = |answers| OfBodies { a: of_a, b: of_b, options, tolerance, answers };
    let (smooth, of_form) = if a.is_smooth() { ((a, standing), poses_b) } else { ((b, poses_b), standing) };
    let (form, shape) = match method {
        LaneMethod::Smooth => {
            return dispatch_lanes(Batch { a, pose_a, b, poses_b, options, tolerance, answers });
        }
        LaneMethod::Beside(form, shape) => ((form, of_form), shape),
        LaneMethod::Shapes(forms) => return distances(of_bodies(answers), forms),
    };
    let work = ShapeWork { smooth, form, answers: of_bodies(answers) };
    match shape {
        LaneShape::Ball(radius) => work.beside(Segment { half_length: 0.0 }, radius),
        LaneShape::Cuboid(set) => work.beside(set, 0.0),
        LaneShape::Cylinder(set) => work.beside(set, 0.0),
    }
}

/// A smooth body beside a shape, as it is to be answered.
struct ShapeWork<'a> {
    smooth: (&'a Body, &'a [Pose]),
    form: (&'a ClosedForm, &'a [Pose]),
    answers: OfBodies<'a>,
}

impl ShapeWork<'_> {
    /// Beside all that is within a radius (metres) of this set: of a ball by its centre, else, and
    /// without a radius, by Newton's method.
    fn beside(self, set: impl LaneSet, form_radius: f64) {
        let Self { smooth, form, answers } = self;
        let batch = ShapeBatch { smooth, form, set, tolerance: answers.tolerance, answers };
        match (smooth.0.closed_form(), ball_radius_m(smooth.0)) {
            (Some(ball), Some(radius)) if runs(Stage::ClosedForm) => {
                dispatch_lanes(BallBatch { batch, radius, form_radius, displacement: ball.displacement_m() });
            }
            _ => dispatch_lanes(batch),
        }
    }
}

/// A batch of two smooth bodies as work for the widest arithmetic.
struct Batch<'a> {
    a: &'a Body,
    pose_a: &'a Pose,
    b: &'a Body,
    poses_b: &'a [Pose],
    options: &'a Options<'a>,
    tolerance: f64,
    answers: &'a mut [Distance],
}

impl WithSimd for Batch<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        run(simd, &mut self);
    }
}

/// A start that says whether Newton's method in lanes has diverged, as it would from there again.
fn cold_start(diverged: bool) -> WarmStart {
    WarmStart { hint: if diverged { Hint::Diverged } else { Hint::Cold }, ..WarmStart::default() }
}

impl Rounds for Batch<'_> {
    fn poses(&self) -> usize {
        self.poses_b.len()
    }

    fn is_stopped(&self) -> bool {
        self.options.stopped()
    }

    /// Rounds in single precision, after which the poses wait for what is next; fresh ones are
    /// started first, and left out where they seem to overlap.
    #[inline(always)]
    fn approach<S: Simd, N: Vector<S>>(
        &mut self,
        simd: S,
        mut group: Group<MAX_COARSE>,
        fresh: bool,
        far: &mut Waiting,
        near: &mut Waiting,
    ) {
        let relative: Relative<N> = self.relative(simd, &group.pose);
        let (side_a, side_b) = (Side::at_home(simd, self.a, 0), Side::away(simd, self.b, 0, &relative));
        let limits = limits(self.a, self.b);
        let (mut at, overlapping) = if fresh {
            let n = facing(simd, self.a, self.b, &relative);
            let (Start { x, y, n }, _) = meeting(simd, self.a, self.b, &relative, n, None);
            let at = Iterate { x, y, n };
            (at, self.overlapping(simd, &at, (&side_a, &side_b)))
        } else {
            (Iterate::load(simd, &group), 0)
        };
        let rounds = if fresh { COARSE } else { 1 };
        let mut square = N::splat(simd, f64::NAN);
        for _ in 0..rounds {
            let ((jet_a, _), (jet_b, _)) = (side_a.jet(simd, at.x), side_b.jet(simd, at.y));
            let here = at.linearize(simd, (&side_a, &jet_a), (&side_b, &jet_b), limits);
            at.advance(simd, &here);
            square = here.square;
        }
        at.store(&mut group);
        // Where single precision has no number for something the pose is left out, too.
        let within = |most: f64| N::bits(simd, square.le(N::splat(simd, most)));
        let (close, straight, open) =
            (within(NEARLY_CONVERGED), within(DIVERGED), within(f32::MAX.into()) & !overlapping);
        for lane in 0..group.count {
            group.rounds[lane] += rounds;
            let (open, late) = (open >> lane & 1 == 1, group.rounds[lane] >= MOST_COARSE);
            let diverged = open && late && straight >> lane & 1 == 0;
            if !open || diverged {
                self.solve_alone(group.pose[lane], group.rounds[lane], cold_start(diverged));
            } else if late || close >> lane & 1 == 1 {
                near.push(&group, lane);
            } else {
                far.push(&group, lane);
            }
        }
    }

    /// One round of a group that proves: writes the answers and lets the other poses wait.
    #[inline(always)]
    fn prove<S: Simd>(&mut self, simd: S, mut group: Group<MAX_LANES>, waiting: &mut Waiting) {
        let splat = |value: f64| Lanes::<S>::splat(simd, value);
        let relative: Relative<Lanes<S>> = self.relative(simd, &group.pose);
        let (side_a, side_b) = (Side::at_home(simd, self.a, 0), Side::away(simd, self.b, 0, &relative));
        let limits = limits(self.a, self.b);
        let worth = worth_a_bracket(limits);
        let mut at = Iterate::load(simd, &group);
        let mut open = (1_u32 << group.count) - 1;
        let mut answered = 0;
        let ((jet_a, inside_a), (jet_b, inside_b)) = (side_a.jet(simd, at.x), side_b.jet(simd, at.y));
        let here = at.linearize(simd, (&side_a, &jet_a), (&side_b, &jet_b), limits);
        let inside = Lanes::and(simd, inside_a, inside_b);
        let short = Lanes::and(simd, inside, here.step.square(simd, worth).le(splat(1.0)));
        if Lanes::bits(simd, short) & open != 0 {
            let next_a = side_a.extrapolate(simd, &jet_a, &here.local.0, here.step.dx);
            let next_b = side_b.extrapolate(simd, &jet_b, &here.local.1, here.step.dy);
            let next = subtract(add(here.difference, here.step.dx), here.step.dy);
            let found = bracket(simd, (&side_a, &next_a), (&side_b, &next_b), next);
            let enough = splat(self.tolerance).max(found.rounding * splat(4.0));
            let width = found.upper - found.lower;
            let apart = Lanes::and(simd, short, splat(f64::MIN_POSITIVE).le(found.lower));
            let settled = Lanes::and(simd, apart, Lanes::and(simd, found.off.le(splat(ALIGNED)), width.le(enough)));
            let settled = Lanes::bits(simd, settled) & open;
            // What rounding keeps wider than asked for, double-double arithmetic narrows: one by
            // one.
            answered = settled & Lanes::bits(simd, width.le(splat(self.tolerance)));
            open &= !settled;
            if answered != 0 {
                let x = moved(at.x, add(here.step.dx, found.to_a), &here.frame);
                let y = moved(at.y, add(here.step.dy, found.to_b), &here.frame);
                let n = apply_transposed(&here.frame, found.normal);
                self.write(simd, &group, answered, [found.lower, found.upper], found.multipliers, [x, y, n]);
            }
        }
        if answered == (1 << group.count) - 1 {
            return;
        }
        at.advance(simd, &here);
        at.store(&mut group);
        let straight = Lanes::bits(simd, here.square.le(splat(DIVERGED)));
        for lane in 0..group.count {
            group.rounds[lane] += 1;
            let open = open >> lane & 1 == 1;
            let diverged = open && group.rounds[lane] >= MOST_COARSE && straight >> lane & 1 == 0;
            if open && !diverged && group.rounds[lane] < MOST_ROUNDS {
                waiting.push(&group, lane);
            } else if answered >> lane & 1 == 0 {
                self.solve_alone(group.pose[lane], group.rounds[lane], cold_start(diverged));
            }
        }
    }

    /// Answers a pose by a query for it alone, after the rounds that it has gone through in lanes.
    #[inline(never)]
    fn solve_alone(&mut self, pose: usize, rounds: u32, warm: WarmStart) {
        let b = (self.b, &self.poses_b[pose]);
        self.answers[pose] = solve_alone((self.a, self.pose_a), b, (self.options, rounds), warm);
    }
}

impl Batch<'_> {
    /// The lanes in which the middle between the points seems to lie in both bodies: single queries
    /// prove that fast.
    #[inline(always)]
    fn overlapping<S: Simd, N: Vector<S>>(
        &self,
        simd: S,
        at: &Iterate<N>,
        (side_a, side_b): (&Side<'_, N>, &Side<'_, N>),
    ) -> u32 {
        let one = N::splat(simd, 1.0);
        let across = N::bits(simd, dot(at.n, subtract(at.x, at.y)).le(N::splat(simd, 0.0)));
        if across == 0 {
            return 0;
        }
        let middle = middle(simd, self.a, self.b, at.x, at.y);
        let ((in_a, _), (in_b, _)) = (side_a.jet(simd, middle), side_b.jet(simd, middle));
        across & N::bits(simd, in_a.value.max(in_b.value).le(one))
    }

    /// B at the poses as seen from A.
    #[inline(always)]
    fn relative<S: Simd, N: Vector<S>, const LANES: usize>(&self, simd: S, poses: &[usize; LANES]) -> Relative<N> {
        let (standing, moving) = (std::slice::from_ref(self.pose_a), self.poses_b);
        let other = lane_rotations::<S, N, LANES>(simd, moving, poses);
        let translation = lane_translations::<S, N, LANES>(simd, moving, standing, poses);
        let own = splat_quaternion(simd, self.pose_a.rotation());
        let rotation = rotation_by(simd, conjugate_times(own, other));
        let frame = rows(simd, self.pose_a.rotation().to_rotation_matrix().matrix());
        let translation = apply_transposed(&frame, translation);
        let home = (&self.a.normalization().center, self.a.trust().center);
        Relative::from_parts(simd, home, rotation, translation, self.b)
    }

    /// Writes the answers of the lanes that are set in `proven`.
    #[inline(always)]
    fn write<S: Simd>(
        &mut self,
        simd: S,
        group: &Group<MAX_LANES>,
        proven: u32,
        [lower, upper]: [Lanes<S>; 2],
        [of_a, of_b]: [Lanes<S>; 2],
        [x, y, n]: [V3<Lanes<S>>; 3],
    ) {
        let frame = rows(simd, self.pose_a.rotation().to_rotation_matrix().matrix());
        let place = self.pose_a.transform_point(&self.a.normalization().center);
        let splat = |value: f64| Lanes::<S>::splat(simd, value);
        let place = [splat(place.x), splat(place.y), splat(place.z)];
        let (x, y, n) = (add(place, apply(&frame, x)), add(place, apply(&frame, y)), apply(&frame, n));
        let mut columns = Aligned([[0.0; MAX_LANES]; 13]);
        let numbers = [lower, upper, of_a, of_b, x[0], x[1], x[2], y[0], y[1], y[2], n[0], n[1], n[2]];
        for (number, column) in numbers.into_iter().zip(&mut columns.0) {
            number.store(column);
        }
        for lane in 0..group.count {
            if proven >> lane & 1 == 0 {
                continue;
            }
            let entry = |i: usize| columns.0[i][lane];
            let vector = |i: usize| Vector3::new(entry(i), entry(i + 1), entry(i + 2));
            self.answers[group.pose[lane]] = Distance {
                parts: [0, 0],
                tied: false,
                status: Status::Converged,
                lower: entry(0),
                upper: entry(1),
                witness_a: vector(4),
                witness_b: vector(7),
                normal: Some(vector(10)),
                active_a: ActiveConstraints::single(0, entry(2)),
                active_b: ActiveConstraints::single(0, entry(3)),
                iterations: group.rounds[lane] + 1,
            };
        }
    }
}

#[cfg(test)]
mod tests;
