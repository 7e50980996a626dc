//! Distances of one pair at many poses at once, a pose in each lane of the vectors.
//!
//! All poses are solved cold: the start of [`crate::measure::start`], then rounds of evaluation and
//! step until the bracket is narrow. The first rounds, which are far off in any precision, are of
//! single precision, for more poses at a time. Those that bracket are of double; the poses that
//! need more than one wait until there is a group of them, so that the slowest does not hold up the
//! others. A lane computes from its own pose only and selects where a single query would branch, so
//! that no answer depends on the other poses of the batch.

use crate::body::{Body, Solid};
use crate::measure::distance::{Distance, distance};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{M3, V3, add, add_scaled, apply, apply_transposed, basis, dot, rows, subtract};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::continuation::{limits, worth_a_bracket};
use crate::measure::solver::initial_guess::{Start, facing, meeting, middle};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::tangent_newton::{
    ALIGNED, Plane, Relative, Side, Step, SurfaceCurvature, bracket, moved, newton,
};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::{
    Aligned, Lanes, MAX_LANES, MAX_SINGLES, Number, NumberJet, Simd, Singles, Twice, Vector, WithSimd, dispatch_lanes,
};
use nalgebra::Vector3;
use std::ops::Range;

/// Why a batch is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BatchError {
    /// No poses.
    #[error("the batch is empty; give at least one pose")]
    Empty,
    /// Not a place for every answer.
    #[error("{poses} poses but places for {answers} answers; give one place for each pose")]
    Lengths {
        /// Number of poses.
        poses: usize,
        /// Number of places for answers.
        answers: usize,
    },
}

/// Euclidean distances between solid `a` at `pose_a` and solid `b` at each of `poses_b` (body to
/// world), written to `answers` in the order of the poses.
///
/// Each answer is one of [`distance`] from a cold start in all that is proven of it, and depends on
/// its own pose only, to the last bit. Single bodies of one constraint are solved several poses at
/// a time, which takes a fraction of the time of as many queries; all others, and poses that do not
/// converge at once such as those in contact, are solved one by one.
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
        && a.is_smooth()
        && b.is_smooth()
        && options.max_iterations() >= MOST_ROUNDS
        && runs(Stage::Lanes)
    {
        in_lanes((a, pose_a), (b, poses_b), options, answers);
    } else {
        for (answer, pose_b) in answers.iter_mut().zip(poses_b) {
            *answer = distance(a, pose_a, b, pose_b, options, &mut WarmStart::default());
        }
    }
    Ok(())
}

/// The answers of single bodies of one constraint. Not generic, so that it is compiled with this
/// crate, whatever its callers are compiled for.
fn in_lanes(
    (a, pose_a): (&Body, &Pose),
    (b, poses_b): (&Body, &[Pose]),
    options: &Options<'_>,
    answers: &mut [Distance],
) {
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    dispatch_lanes(Batch { a, pose_a, b, poses_b, options, tolerance, answers });
}

/// Rounds in single precision that every pose goes through.
const COARSE: u32 = 2;

/// Most of them.
const MOST_COARSE: u32 = 6;

/// Square of the last step relative to the longest one allowed, below which the next one, of
/// double precision, is likely to end with a narrow bracket: a hundredth of a move leaves about
/// its square. It changes time only; no test pins it.
const NEARLY_CONVERGED: f64 = 1e-4;

/// The same above which Newton's method has diverged after [`MOST_COARSE`] rounds: a fifth of the
/// longest move, as long as in a search from a cold start then. Smaller, poses that would have
/// converged are solved alone: `lanes_answer_alike_in_any_unit` counts them.
const DIVERGED: f64 = 0.04;

/// Most rounds of a pose before it is solved alone.
const MOST_ROUNDS: u32 = 8;

/// A batch as work for the widest arithmetic. Each answer is written once: by the lanes, or by a
/// query for the pose alone.
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
        let (lanes, singles) = (Lanes::<S>::COUNT, Coarse::<S>::COUNT);
        let (mut far, mut near) = (Waiting::none(), Waiting::none());
        let mut next = 0;
        while !self.options.stopped() {
            let left = self.poses_b.len() - next;
            if near.len >= lanes || near.len > 0 && far.len + left == 0 {
                let group = near.take(lanes);
                self.prove(simd, group, &mut near);
            } else if far.len + left > 0 {
                let fresh = far.len < singles && left > 0;
                let group = if fresh { Group::fresh(next..next + left.min(singles)) } else { far.take(singles) };
                next += if fresh { group.count } else { 0 };
                if group.count > Singles::<S>::COUNT {
                    self.approach::<S, Coarse<S>>(simd, group, fresh, &mut far, &mut near);
                } else {
                    self.approach::<S, Singles<S>>(simd, group, fresh, &mut far, &mut near);
                }
            } else {
                return;
            }
        }
        // Stopped: what is known by now of the poses that are left is the answer.
        for waiting in [&far, &near] {
            for (pose, rounds) in waiting.pose.iter().zip(&waiting.rounds).take(waiting.len) {
                self.solve_alone(*pose, *rounds, WarmStart::default());
            }
        }
        for pose in next..self.poses_b.len() {
            self.solve_alone(pose, 0, WarmStart::default());
        }
    }
}

/// The numbers of the first rounds, unless there are few poses: while one vector waits for its
/// operands the other is computed with.
type Coarse<S> = Twice<Singles<S>>;

/// Most lanes of them.
const MAX_COARSE: usize = 2 * MAX_SINGLES;

/// Poses of the batch in lanes.
struct Group<const LANES: usize> {
    /// Lanes in use.
    count: usize,
    /// Index of the pose.
    pose: [usize; LANES],
    /// Rounds that are behind it.
    rounds: [u32; LANES],
    /// Coordinates of x, y and n.
    at: Aligned<[[f64; LANES]; 9]>,
}

impl<const LANES: usize> Group<LANES> {
    /// Poses that nothing is known of yet; lanes to spare solve the last one once more.
    #[inline(always)]
    fn fresh(poses: Range<usize>) -> Self {
        let pose = std::array::from_fn(|lane| (poses.start + lane).min(poses.end - 1));
        Self { count: poses.len(), pose, rounds: [0; LANES], at: Aligned([[0.0; LANES]; 9]) }
    }
}

/// Most poses that wait for one kind of round: one too few for a group, and those of a whole one.
const MOST_WAITING: usize = 2 * MAX_COARSE;

/// Poses that wait for a round.
struct Waiting {
    len: usize,
    pose: [usize; MOST_WAITING],
    rounds: [u32; MOST_WAITING],
    at: [[f64; MOST_WAITING]; 9],
}

impl Waiting {
    fn none() -> Self {
        Self { len: 0, pose: [0; MOST_WAITING], rounds: [0; MOST_WAITING], at: [[0.0; MOST_WAITING]; 9] }
    }

    /// Lets a lane of a group wait.
    #[inline(always)]
    fn push<const LANES: usize>(&mut self, group: &Group<LANES>, lane: usize) {
        self.pose[self.len] = group.pose[lane];
        self.rounds[self.len] = group.rounds[lane];
        for (waiting, column) in self.at.iter_mut().zip(&group.at.0) {
            waiting[self.len] = column[lane];
        }
        self.len += 1;
    }

    /// At most so many of the last entries as a group; lanes to spare hold some that no longer
    /// wait.
    #[inline(always)]
    fn take<const LANES: usize>(&mut self, lanes: usize) -> Group<LANES> {
        let count = lanes.min(self.len);
        self.len -= count;
        let taken = self.len..self.len + lanes;
        let mut group = Group { count, pose: [0; LANES], rounds: [0; LANES], at: Aligned([[0.0; LANES]; 9]) };
        group.pose[..lanes].copy_from_slice(&self.pose[taken.clone()]);
        group.rounds[..lanes].copy_from_slice(&self.rounds[taken.clone()]);
        for (column, waiting) in group.at.0.iter_mut().zip(&self.at) {
            column[..lanes].copy_from_slice(&waiting[taken.clone()]);
        }
        group
    }
}

/// A start that says whether Newton's method in lanes has diverged, as it would from there again.
fn cold_start(diverged: bool) -> WarmStart {
    if diverged { Hint::Diverged.into() } else { WarmStart::default() }
}

/// Trial points, and a normal of any length.
#[derive(Clone, Copy)]
struct Iterate<N> {
    x: V3<N>,
    y: V3<N>,
    n: V3<N>,
}

/// A Newton step with the bases it was made in.
struct Linearized<N> {
    frame: M3<N>,
    local: (M3<N>, M3<N>),
    difference: V3<N>,
    step: Step<N>,
    /// Square of its moves relative to their limits.
    square: N,
}

impl<N: Copy> Iterate<N> {
    #[inline(always)]
    fn linearize<S: Simd>(
        &self,
        simd: S,
        (side_a, jet_a): (&Side<'_, N>, &NumberJet<N>),
        (side_b, jet_b): (&Side<'_, N>, &NumberJet<N>),
        limits: [f64; 2],
    ) -> Linearized<N>
    where
        N: Number<S>,
    {
        let frame = basis(simd, self.n);
        let local = (side_a.localize(simd, &frame), side_b.localize(simd, &frame));
        let (a, b) = (Plane::new(simd, jet_a, &local.0), Plane::new(simd, jet_b, &local.1));
        let (curvature_a, curvature_b) =
            (SurfaceCurvature::new(simd, jet_a, &local.0), SurfaceCurvature::new(simd, jet_b, &local.1));
        let difference = apply(&frame, subtract(self.x, self.y));
        let zero = N::splat(simd, 0.0);
        let (step, _) = newton(simd, (&a, &curvature_a), (&b, &curvature_b), difference, zero);
        let square = step.square(simd, limits);
        Linearized { frame, local, difference, step, square }
    }

    /// What a group was left with.
    #[inline(always)]
    fn load<S: Simd, const LANES: usize>(simd: S, group: &Group<LANES>) -> Self
    where
        N: Vector<S>,
    {
        let column = |i: usize| N::load(simd, &group.at.0[i]);
        Self {
            x: [column(0), column(1), column(2)],
            y: [column(3), column(4), column(5)],
            n: [column(6), column(7), column(8)],
        }
    }

    /// Leaves it to the group.
    #[inline(always)]
    fn store<S: Simd, const LANES: usize>(&self, group: &mut Group<LANES>)
    where
        N: Vector<S>,
    {
        for (coordinate, column) in [self.x, self.y, self.n].as_flattened().iter().zip(&mut group.at.0) {
            coordinate.store(column);
        }
    }

    /// Takes a step, within its limits.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, simd: S, Linearized { frame, step, square, .. }: &Linearized<N>)
    where
        N: Number<S>,
    {
        let step = step.at_most(simd, *square);
        self.x = moved(self.x, step.dx, frame);
        self.y = moved(self.y, step.dy, frame);
        self.n = add_scaled(add_scaled(frame[2], step.dn[0], frame[0]), step.dn[1], frame[1]);
    }
}

impl Batch<'_> {
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
        let (side_a, side_b) = (Side::at_home(simd, self.a, 0), Side::away(self.b, 0, &relative));
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
        let (side_a, side_b) = (Side::at_home(simd, self.a, 0), Side::away(self.b, 0, &relative));
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
            // What rounding keeps wider than asked for, twice the precision narrows: one by one.
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
    fn solve_alone(&mut self, pose: usize, rounds: u32, mut warm: WarmStart) {
        let options = self.options.after(rounds);
        let found = distance(self.a, self.pose_a, self.b, &self.poses_b[pose], &options, &mut warm);
        self.answers[pose] = Distance { iterations: found.iterations + rounds, ..found };
    }

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
        let mut columns = Aligned([[0.0; LANES]; 7]);
        for lane in 0..N::COUNT {
            let pose = &self.poses_b[poses[lane]];
            let q = &pose.rotation().coords;
            // Differences of translations are exact to one rounding, however far from the world
            // origin.
            let t = pose.translation() - self.pose_a.translation();
            for (column, entry) in columns.0.iter_mut().zip([q.x, q.y, q.z, q.w, t.x, t.y, t.z]) {
                column[lane] = entry;
            }
        }
        let splat = |value: f64| N::splat(simd, value);
        let column = |i: usize| N::load(simd, &columns.0[i]);
        let own = &self.pose_a.rotation().coords;
        let (u, v) = ([splat(-own.x), splat(-own.y), splat(-own.z)], [column(0), column(1), column(2)]);
        let (u_w, v_w) = (splat(own.w), column(3));
        // The product of the conjugate of A's quaternion with B's.
        let w = u_w * v_w - dot(u, v);
        let i = u_w.mul_add(v[0], v_w * u[0]) + (u[1] * v[2] - u[2] * v[1]);
        let j = u_w.mul_add(v[1], v_w * u[1]) + (u[2] * v[0] - u[0] * v[2]);
        let k = u_w.mul_add(v[2], v_w * u[2]) + (u[0] * v[1] - u[1] * v[0]);
        let (ww, ii, jj, kk) = (w * w, i * i, j * j, k * k);
        let two = splat(2.0);
        let (ij, ik, jk) = (two * i * j, two * i * k, two * j * k);
        let (wi, wj, wk) = (two * w * i, two * w * j, two * w * k);
        let rotation = [
            [ww + ii - jj - kk, ij - wk, wj + ik],
            [wk + ij, ww - ii + jj - kk, jk - wi],
            [ik - wj, wi + jk, ww - ii - jj + kk],
        ];
        let frame = rows(simd, self.pose_a.rotation().to_rotation_matrix().matrix());
        let translation = apply_transposed(&frame, [column(4), column(5), column(6)]);
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
mod tests {
    use super::{BatchError, distance_batch};
    use crate::body::{Body, Compound};
    use crate::measure::solver::stages::{Stage, only};
    use crate::measure::{Distance, Options, Pose, Status, WarmStart, distance};
    use nalgebra::{Vector3, Vector4};
    use std::sync::atomic::AtomicBool;
    use sublevel_testkit::Seeded;

    fn pose(random: &mut Seeded, far: f64) -> Pose {
        let q = Vector4::from_fn(|_, _| random.signed()).normalize();
        Pose::from_quaternion(Vector3::from_fn(|_, _| far * random.signed()), q.into()).unwrap()
    }

    fn body(random: &mut Seeded, degree: u8) -> Body {
        let center = Vector3::from_fn(|_, _| random.signed());
        let half = Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
        if degree == 2 {
            Body::ellipsoid("egg", center, half).unwrap()
        } else {
            Body::superellipsoid("q", center, half, degree).unwrap()
        }
    }

    /// Every number of an answer, bit by bit.
    fn bits(answer: &Distance) -> [u64; 19] {
        let mut numbers = vec![answer.lower, answer.upper, answer.value(), f64::from(answer.iterations)];
        numbers.extend(answer.witness_a.iter().chain(answer.witness_b.iter()));
        numbers.extend(answer.normal.unwrap_or_default().iter());
        numbers.push(f64::from(u8::from(answer.normal.is_some())));
        numbers.push(f64::from(u8::from(answer.status == Status::Converged)));
        for active in [answer.active_a, answer.active_b] {
            let (sum, first) = active.iter().fold((0.0, 0.0), |(sum, _), (index, m)| (sum + m, index as f64));
            numbers.extend([sum, first]);
        }
        std::array::from_fn(|i| numbers[i].to_bits())
    }

    fn solve(a: &Body, pose_a: &Pose, b: &Body, poses: &[Pose]) -> Vec<[u64; 19]> {
        let mut answers = vec![Distance::default(); poses.len()];
        distance_batch(a, pose_a, b, poses, &Options::default(), &mut answers).unwrap();
        answers.iter().map(bits).collect()
    }

    #[test]
    fn answers_are_those_of_single_queries() {
        for seed in 0..60 {
            let mut random = Seeded(seed);
            let degrees = [2_u8, 4, 6, 8];
            let (a, b) =
                (body(&mut random, degrees[seed as usize % 4]), body(&mut random, degrees[seed as usize / 4 % 4]));
            let pose_a = pose(&mut random, 2.0);
            // Some in contact, some far away.
            let poses: Vec<Pose> =
                (0..64).map(|i| pose(&mut random, if i % 8 == 0 { 1e3 } else { 2.0 + 0.1 * i as f64 })).collect();
            let mut answers = vec![Distance::default(); poses.len()];
            distance_batch(&a, &pose_a, &b, &poses, &Options::default(), &mut answers).unwrap();
            for (i, (answer, pose_b)) in answers.iter().zip(&poses).enumerate() {
                let single = distance(&a, &pose_a, &b, pose_b, &Options::default(), &mut WarmStart::default());
                let context = format!("seed {seed}, pose {i}: {answer:?} against {single:?}");
                assert_eq!(answer.status, single.status, "{context}");
                assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{context}");
                let between = (answer.witness_a - answer.witness_b).norm();
                assert!((between - answer.upper).abs() <= 1e-9 * (1.0 + answer.upper), "{context}");
                let inverse = |pose: &Pose, x: &Vector3<f64>| pose.rotation().inverse() * (x - pose.translation());
                assert!(a.value(&inverse(&pose_a, &answer.witness_a)) <= 1.0 + 1e-9, "{context}");
                assert!(b.value(&inverse(pose_b, &answer.witness_b)) <= 1.0 + 1e-9, "{context}");
                if let (Some(n), Some(m)) = (answer.normal, single.normal) {
                    // Each is good to the square root of its bracket.
                    assert!((n - m).norm() < 1e-3, "{context}");
                    let multiplier = |answer: &Distance| answer.active_a.iter().map(|(_, value)| value).sum::<f64>();
                    let (of_batch, of_single) = (multiplier(answer), multiplier(&single));
                    assert!((of_batch - of_single).abs() <= 1e-3 * of_single, "{context}");
                }
            }
        }
    }

    #[test]
    fn far_poses_are_as_narrow_as_single_queries() {
        let small = Body::superellipsoid("small", Vector3::zeros(), Vector3::new(0.03, 0.02, 0.025), 4).unwrap();
        let large = Body::superellipsoid("large", Vector3::zeros(), Vector3::new(0.8, 0.5, 1.1), 8).unwrap();
        let mut random = Seeded(21);
        let poses: Vec<Pose> = (0..400).map(|_| pose(&mut random, 60.0)).collect();
        for (a, b) in [(&small, &large), (&large, &small), (&small, &small)] {
            let mut answers = vec![Distance::default(); poses.len()];
            distance_batch(a, &Pose::identity(), b, &poses, &Options::default(), &mut answers).unwrap();
            for (answer, pose_b) in answers.iter().zip(&poses) {
                let single = distance(a, &Pose::identity(), b, pose_b, &Options::default(), &mut WarmStart::default());
                assert_eq!(answer.status, single.status, "{answer:?} against {single:?}");
            }
        }
    }

    #[test]
    fn an_answer_does_not_depend_on_its_neighbours() {
        for seed in 0..12 {
            let mut random = Seeded(seed);
            let (a, b) = (body(&mut random, 6), body(&mut random, if seed % 2 == 0 { 6 } else { 4 }));
            let pose_a = pose(&mut random, 1.0);
            let poses: Vec<Pose> = (0..61).map(|_| pose(&mut random, 4.0)).collect();
            let answers = solve(&a, &pose_a, &b, &poses);
            let mut order: Vec<usize> = (0..poses.len()).collect();
            for round in 0..4 {
                for i in (1..order.len()).rev() {
                    order.swap(i, ((random.signed().abs() * (i + 1) as f64) as usize).min(i));
                }
                let shuffled: Vec<Pose> = order.iter().map(|&i| poses[i]).collect();
                for (found, &i) in solve(&a, &pose_a, &b, &shuffled).iter().zip(&order) {
                    assert_eq!(*found, answers[i], "seed {seed}, round {round}, pose {i}");
                }
            }
            for size in 1..=20 {
                for (chunk, known) in poses.chunks(size).zip(answers.chunks(size)) {
                    assert_eq!(solve(&a, &pose_a, &b, chunk), known, "seed {seed}, size {size}");
                }
            }
            // Neighbours that overlap, that are far away, that are the same.
            for neighbour in [pose_a, pose(&mut random, 1e6), poses[0]] {
                for i in 0..poses.len() {
                    let mut others = vec![neighbour; 17];
                    others[i % 17] = poses[i];
                    assert_eq!(solve(&a, &pose_a, &b, &others)[i % 17], answers[i], "seed {seed}, pose {i}");
                }
            }
        }
    }

    #[test]
    fn other_solids_are_solved_one_by_one() {
        let mut random = Seeded(3);
        let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
        let cuboid = Body::cuboid("box", Vector3::new(1.0, 0.5, 0.7)).unwrap();
        let compound = Compound::new("two", vec![ball.clone(), cuboid.clone()]).unwrap();
        let poses: Vec<Pose> = (0..20).map(|_| pose(&mut random, 3.0)).collect();
        let options = Options::default();
        let mut answers = vec![Distance::default(); poses.len()];
        distance_batch(&compound, &Pose::identity(), &ball, &poses, &options, &mut answers).unwrap();
        for (answer, pose_b) in answers.iter().zip(&poses) {
            let single = distance(&compound, &Pose::identity(), &ball, pose_b, &options, &mut WarmStart::default());
            assert_eq!(bits(answer), bits(&single));
        }
        distance_batch(&cuboid, &Pose::identity(), &ball, &poses, &options, &mut answers).unwrap();
        for (answer, pose_b) in answers.iter().zip(&poses) {
            let single = distance(&cuboid, &Pose::identity(), &ball, pose_b, &options, &mut WarmStart::default());
            assert_eq!(bits(answer), bits(&single));
        }
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
        let here = Pose::identity();
        let batch = |poses: &[Pose], answers: &mut [Distance]| {
            distance_batch(&ball, &here, &ball, poses, &Options::default(), answers)
        };
        assert_eq!(batch(&[], &mut []), Err(BatchError::Empty));
        let mut answers = [Distance::default(); 2];
        assert_eq!(batch(&[here; 3], &mut answers), Err(BatchError::Lengths { poses: 3, answers: 2 }));
        assert_eq!(batch(&[], &mut answers), Err(BatchError::Lengths { poses: 0, answers: 2 }));
    }

    #[test]
    fn limits_and_stops_leave_true_brackets() {
        let mut random = Seeded(8);
        let (a, b) = (body(&mut random, 6), body(&mut random, 8));
        let poses: Vec<Pose> = (0..40).map(|_| pose(&mut random, 6.0)).collect();
        let stop = AtomicBool::new(true);
        let limits = [Options::default().with_max_iterations(1).unwrap(), Options::default().with_stop(&stop)];
        for options in limits {
            let mut answers = vec![Distance::default(); poses.len()];
            distance_batch(&a, &Pose::identity(), &b, &poses, &options, &mut answers).unwrap();
            for (answer, pose_b) in answers.iter().zip(&poses) {
                let truth = distance(&a, &Pose::identity(), &b, pose_b, &Options::default(), &mut WarmStart::default());
                assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{answer:?} {truth:?}");
            }
        }
    }

    /// How many poses are answered in lanes, without any method that solves a pose alone.
    fn answered(a: &Body, b: &Body, poses: &[Pose]) -> usize {
        let mut answers = vec![Distance::default(); poses.len()];
        let options = Options::default();
        only(&[Stage::Lanes], || distance_batch(a, &Pose::identity(), b, poses, &options, &mut answers)).unwrap();
        answers.iter().filter(|answer| answer.status == Status::Converged && answer.lower > 0.0).count()
    }

    #[test]
    fn lanes_answer_alike_in_any_unit() {
        // From nanometres to gigametres; powers of two change no digit.
        let answered_in = |unit: f64, degrees: [u8; 2], far: f64| {
            let mut random = Seeded(5);
            let [a, b] = degrees.map(|degree| {
                let half = Vector3::from_fn(|_, _| unit * 2_f64.powf(random.signed()));
                if degree == 2 {
                    Body::ellipsoid("egg", Vector3::zeros(), half).unwrap()
                } else {
                    Body::superellipsoid("q", Vector3::zeros(), half, degree).unwrap()
                }
            });
            let poses: Vec<Pose> = (0..200)
                .map(|_| {
                    let q = Vector4::from_fn(|_, _| random.signed()).normalize();
                    let t = Vector3::from_fn(|_, _| random.signed()).normalize() * (far * unit);
                    Pose::from_quaternion(t, q.into()).unwrap()
                })
                .collect();
            answered(&a, &b, &poses)
        };
        for degrees in [[2, 2], [4, 6], [8, 2]] {
            for far in [6.0, 60.0, 600.0] {
                let count = answered_in(1.0, degrees, far);
                assert!(count >= 180, "degrees {degrees:?}, far {far}: {count} of 200");
                for exponent in [-30, -20, -10, 10, 20, 30] {
                    let unit = 2_f64.powi(exponent);
                    let found = answered_in(unit, degrees, far);
                    let context = format!("unit {unit:e}, degrees {degrees:?}, far {far}: {found} of 200");
                    // So far away that single precision runs out of numbers some poses are solved
                    // alone.
                    assert!(if far < 100.0 { found == count } else { found >= 180 }, "{context}, {count} in metres");
                }
            }
        }
    }

    #[test]
    fn concentric_bodies_do_not_linger() {
        let (a, b) = (body(&mut Seeded(1), 2), body(&mut Seeded(1), 2));
        let mut answers = [Distance::default(); 3];
        distance_batch(&a, &Pose::identity(), &b, &[Pose::identity(); 3], &Options::default(), &mut answers).unwrap();
        for answer in &answers {
            assert_eq!((answer.status, answer.lower), (Status::Converged, 0.0), "{answer:?}");
        }
        assert_eq!(answered(&a, &b, &[Pose::identity(); 3]), 0);
    }

    #[test]
    fn what_the_places_held_before_is_gone() {
        let mut random = Seeded(4);
        let (a, b) = (body(&mut random, 4), body(&mut random, 6));
        let poses: Vec<Pose> = (0..90).map(|_| pose(&mut random, 5.0)).collect();
        let stop = AtomicBool::new(true);
        let here = Pose::identity();
        let truth = |pose| distance(&a, &here, &b, pose, &Options::default(), &mut WarmStart::default());
        for options in [Options::default(), Options::default().with_stop(&stop)] {
            let stale = Distance { status: Status::Converged, lower: 40.0, upper: 40.0, ..Distance::default() };
            let mut answers = vec![stale; poses.len()];
            distance_batch(&a, &here, &b, &poses, &options, &mut answers).unwrap();
            for (answer, truth) in answers.iter().zip(poses.iter().map(truth)) {
                assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{answer:?} {truth:?}");
            }
        }
    }

    #[test]
    fn iterations_keep_their_limit() {
        let mut random = Seeded(9);
        let (a, b) = (body(&mut random, 8), body(&mut random, 8));
        // Many at touch, where Newton's method in lanes comes to nothing.
        let poses: Vec<Pose> = (0..600).map(|i| pose(&mut random, if i % 2 == 0 { 1.5 } else { 4.0 })).collect();
        for most in [15, 16, 17, 40] {
            let options = Options::default().with_max_iterations(most).unwrap();
            let mut answers = vec![Distance::default(); poses.len()];
            distance_batch(&a, &Pose::identity(), &b, &poses, &options, &mut answers).unwrap();
            for answer in &answers {
                assert!(answer.iterations <= most, "at most {most}: {answer:?}");
            }
        }
    }
}
