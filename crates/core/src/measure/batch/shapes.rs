//! A smooth body and a box, a cylinder or a segment at several poses at once: starts from support
//! tables and first rounds in single precision, then rounds that bracket.

use super::lane_poses::{lane_rotations, lane_translations};
use super::rounds::{COARSE, MOST_COARSE, MOST_ROUNDS, Rounds, run, solve_alone};
use super::waiting::{Group, MAX_COARSE, Waiting};
use crate::body::{Body, ClosedForm};
use crate::measure::distance::{Distance, Exact};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::quaternion::{conjugate_times, rotation_by};
use crate::measure::frames::vector::{M3, V3, add, apply, apply_transposed, dot, scaled};
use crate::measure::options::Options;
use crate::measure::solver::exact_shape::{
    ExactProven, LaneBracket, LaneMove, LaneOffset, LaneSet, WORTH_A_BRACKET_SQUARED, bracket, newton, start,
};
use crate::measure::solver::tangent_newton::{FLATTEST, LONGEST_STEP, Plane, Relative, Side, SurfaceCurvature, moved};
use crate::measure::warm::WarmStart;
use crate::polynomial::{Aligned, Lanes, MAX_LANES, Number, NumberJet, Simd, Vector, WithSimd};

/// Square of the last step in normalized coordinates, relative to the body's size there,
/// dimensionless, below which the next step, in double precision, is likely to end with a narrow
/// bracket.
///
/// A larger value makes brackets before they are narrow, a smaller one takes a round more in single
/// precision. It changes time only; no test pins it.
const NEARLY_CONVERGED: f64 = 1e-4;

/// A batch of a smooth body and a shape as work for the widest arithmetic. Either stands at a pose
/// for each answer, or at a single one for all.
pub(super) struct ShapeBatch<'a, P, A> {
    pub(super) smooth: (&'a Body, &'a [Pose]),
    pub(super) form: (&'a ClosedForm, &'a [Pose]),
    pub(super) set: P,
    /// Width of the bracket that is narrow enough, metres.
    pub(super) tolerance: f64,
    pub(super) answers: A,
}

/// Places for what such a batch finds.
pub(super) trait ShapeAnswers {
    /// How many they are.
    fn count(&self) -> usize;

    /// Whether to end with what is known.
    fn is_stopped(&self) -> bool;

    /// Writes what is proven.
    fn write(&mut self, answer: usize, found: &ExactProven);

    /// Answers by a query for it alone, after the rounds that it has gone through in lanes.
    fn solve_alone(&mut self, answer: usize, rounds: u32);
}

/// Distances of two bodies.
pub(super) struct OfBodies<'a> {
    pub(super) a: (&'a Body, &'a Pose),
    pub(super) b: (&'a Body, &'a [Pose]),
    pub(super) options: &'a Options<'a>,
    pub(super) tolerance: f64,
    pub(super) answers: &'a mut [Distance],
}

impl ShapeAnswers for OfBodies<'_> {
    fn count(&self) -> usize {
        self.answers.len()
    }

    fn is_stopped(&self) -> bool {
        self.options.stopped()
    }

    fn write(&mut self, answer: usize, found: &ExactProven) {
        let b = (self.b.0, &self.b.1[answer]);
        let exact = Exact::beside_form(self.a, b).expect("one is smooth, the other has a closed form");
        self.answers[answer] = exact.answer(found, self.tolerance);
    }

    fn solve_alone(&mut self, answer: usize, rounds: u32) {
        let b = (self.b.0, &self.b.1[answer]);
        self.answers[answer] = solve_alone(self.a, b, (self.options, rounds), WarmStart::default());
    }
}

impl<P: LaneSet, A: ShapeAnswers> WithSimd for ShapeBatch<'_, P, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        run(simd, &mut self);
    }
}

/// A step of Newton's method in lanes, from points in the frame of the set.
struct Linearized<S: Simd, N: Number<S>> {
    seen: LaneOffset<N>,
    jet: NumberJet<N>,
    local: M3<N>,
    found: LaneMove<N>,
    /// Square of the step in normalized coordinates, relative to the body's size there.
    square: N,
    /// The lanes in which it leads on.
    open: N::Mask,
}

impl<S: Simd, N: Number<S>> Linearized<S, N> {
    /// Where it leads, within its limits.
    #[inline(always)]
    fn advanced(&self, simd: S, x: V3<N>) -> V3<N> {
        let one = N::splat(simd, 1.0);
        let excess = self.square * N::splat(simd, 1.0 / (LONGEST_STEP * LONGEST_STEP));
        moved(x, scaled(self.found.step, one / excess.max(one).sqrt()), &self.seen.frame)
    }
}

impl<P: LaneSet, A: ShapeAnswers> Rounds for ShapeBatch<'_, P, A> {
    fn poses(&self) -> usize {
        self.answers.count()
    }

    fn is_stopped(&self) -> bool {
        self.answers.is_stopped()
    }

    #[inline(always)]
    fn approach<S: Simd, N: Vector<S>>(
        &mut self,
        simd: S,
        mut group: Group<MAX_COARSE>,
        fresh: bool,
        far: &mut Waiting,
        near: &mut Waiting,
    ) {
        let body = self.smooth.0;
        let relative: Relative<N> = self.relative(simd, &group.pose);
        let side = Side::away(simd, body, 0, &relative);
        let one = N::splat(simd, 1.0);
        let (mut x, mut open) =
            if fresh { self.begin(simd, body, &relative) } else { (load(simd, &group), one.le(one)) };
        let rounds = if fresh { COARSE } else { 1 };
        let mut square = N::splat(simd, f64::NAN);
        for _ in 0..rounds {
            let here = self.linearize(simd, &side, x);
            open = N::and(simd, open, here.open);
            (x, square) = (here.advanced(simd, x), here.square);
        }
        store(x, &mut group);
        let (close, open) = (N::bits(simd, square.le(N::splat(simd, NEARLY_CONVERGED))), N::bits(simd, open));
        for lane in 0..group.count {
            group.rounds[lane] += rounds;
            if open >> lane & 1 == 0 {
                self.solve_alone(group.pose[lane], group.rounds[lane], WarmStart::default());
            } else if group.rounds[lane] >= MOST_COARSE || close >> lane & 1 == 1 {
                near.push(&group, lane);
            } else {
                far.push(&group, lane);
            }
        }
    }

    #[inline(always)]
    fn prove<S: Simd>(&mut self, simd: S, mut group: Group<MAX_LANES>, waiting: &mut Waiting) {
        let body = self.smooth.0;
        let relative: Relative<Lanes<S>> = self.relative(simd, &group.pose);
        let side = Side::away(simd, body, 0, &relative);
        let x = load(simd, &group);
        let here = self.linearize(simd, &side, x);
        let worth = here.square.le(Lanes::<S>::splat(simd, WORTH_A_BRACKET_SQUARED));
        let short = Lanes::<S>::and(simd, here.open, worth);
        let mut answered = 0;
        if Lanes::<S>::bits(simd, short) != 0 {
            let Linearized { seen, jet, local, found, .. } = &here;
            let at = side.extrapolate(simd, jet, local, found.step);
            let set = (&self.set, self.form.0.displacement_m());
            let of_body = (body, &relative, &side);
            let (brackets, proven) = bracket(simd, set, of_body, &at, (found, &seen.frame), self.tolerance);
            answered = Lanes::<S>::bits(simd, Lanes::<S>::and(simd, short, proven));
            write(&mut self.answers, &group, answered, &brackets);
        }
        store(here.advanced(simd, x), &mut group);
        let open = Lanes::<S>::bits(simd, here.open);
        for lane in (0..group.count).filter(|lane| answered >> lane & 1 == 0) {
            group.rounds[lane] += 1;
            if open >> lane & 1 == 1 && group.rounds[lane] < MOST_ROUNDS {
                waiting.push(&group, lane);
            } else {
                self.solve_alone(group.pose[lane], group.rounds[lane], WarmStart::default());
            }
        }
    }

    #[inline(never)]
    fn solve_alone(&mut self, pose: usize, rounds: u32, _: WarmStart) {
        self.answers.solve_alone(pose, rounds);
    }
}

impl<P: LaneSet, A: ShapeAnswers> ShapeBatch<'_, P, A> {
    /// Where fresh poses begin, and the lanes that can.
    #[inline(always)]
    fn begin<S: Simd, N: Vector<S>>(&self, simd: S, body: &Body, relative: &Relative<N>) -> (V3<N>, N::Mask) {
        let own = body.interior_point() - body.normalization().center;
        let own = [N::splat(simd, own.x), N::splat(simd, own.y), N::splat(simd, own.z)];
        let seen = self.set.offset(simd, add(relative.origin, apply(&relative.rotation, own)));
        start(simd, &self.set, body, relative, seen.frame[2])
    }

    #[inline(always)]
    fn linearize<S: Simd, N: Vector<S>>(&self, simd: S, side: &Side<'_, N>, x: V3<N>) -> Linearized<S, N> {
        let body = side.body();
        let seen = self.set.offset(simd, x);
        let (jet, inside) = side.jet(simd, x);
        let local = side.localize(simd, &seen.frame);
        let (plane, bend) = (Plane::new(simd, &jet, &local), SurfaceCurvature::new(simd, &jet, &local));
        let (found, facing) = newton(simd, &self.set, x, &seen, (&plane, &bend), FLATTEST / body.trust().reach);
        let delta = apply_transposed(&local, found.step);
        let square = dot(delta, delta) * N::splat(simd, body.trust().radius.powi(-2));
        let is_finite = square.le(N::splat(simd, f32::MAX.into()));
        let open = N::and(simd, N::and(simd, inside, facing), is_finite);
        Linearized { seen, jet, local, found, square, open }
    }

    /// The smooth body as seen from the shape.
    #[inline(always)]
    pub(super) fn relative<S: Simd, N: Vector<S>, const LANES: usize>(
        &self,
        simd: S,
        poses: &[usize; LANES],
    ) -> Relative<N> {
        let ((body, of_body), (form, of_form)) = (self.smooth, self.form);
        let home = lane_rotations::<S, N, LANES>(simd, of_form, poses);
        let away = lane_rotations::<S, N, LANES>(simd, of_body, poses);
        let t = lane_translations::<S, N, LANES>(simd, of_body, of_form, poses);
        let rotation = rotation_by(simd, conjugate_times(home, away));
        let translation = apply_transposed(&rotation_by(simd, home), t);
        let center = form.center();
        Relative::from_parts(simd, (center, center.norm()), rotation, translation, body)
    }
}

/// Writes the answers of the lanes that are set in `proven`.
#[inline(always)]
pub(super) fn write<S: Simd>(
    answers: &mut impl ShapeAnswers,
    group: &Group<MAX_LANES>,
    proven: u32,
    brackets: &LaneBracket<Lanes<S>>,
) {
    let LaneBracket { lower, upper, x, nearest, n, multiplier } = *brackets;
    let mut columns = Aligned([[0.0; MAX_LANES]; 12]);
    let numbers = [&[lower, upper, multiplier][..], &x, &nearest, &n];
    for (number, column) in numbers.into_iter().flatten().zip(&mut columns.0) {
        number.store(column);
    }
    for lane in (0..group.count).filter(|lane| proven >> lane & 1 == 1) {
        let entry = |i: usize| columns.0[i][lane];
        let vector = |i: usize| [entry(i), entry(i + 1), entry(i + 2)];
        let found = ExactProven {
            lower: entry(0),
            upper: entry(1),
            x: vector(3),
            nearest: vector(6),
            n: vector(9),
            multiplier: entry(2),
            rounds: group.rounds[lane] + 1,
            trace: None,
        };
        answers.write(group.pose[lane], &found);
    }
}

/// Points that a group was left with.
#[inline(always)]
pub(super) fn load<S: Simd, N: Vector<S>, const LANES: usize>(simd: S, group: &Group<LANES>) -> V3<N> {
    let column = |i: usize| N::load(simd, &group.at.0[i]);
    [column(0), column(1), column(2)]
}

/// Leaves points to a group.
#[inline(always)]
pub(super) fn store<S: Simd, N: Vector<S>, const LANES: usize>(x: V3<N>, group: &mut Group<LANES>) {
    for (coordinate, column) in x.into_iter().zip(&mut group.at.0) {
        coordinate.store(column);
    }
}
