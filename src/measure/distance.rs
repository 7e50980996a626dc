//! Euclidean distance between two bodies.

use super::Status;
use super::active::ActiveConstraints;
use super::bracket::{Multipliers, distance_lower, distance_upper};
use super::decide::Goal;
use super::newton::{Active, DistanceNewton};
use super::options::Options;
use super::pair::{Pair, Posed};
use super::pose::Pose;
use super::programs::{Closest, Level, points};
use super::relation::Apart;
use super::sharp::SharpPair;
use super::simplex::{Approach, approach};
use super::smooth::{Follow, Lost, Proven, SEEK_ROUNDS, Seek, Trace};
use super::start::Start;
use super::twist::Twist;
use super::union;
use super::vector::V3;
use super::warm::{Hint, WarmStart};
use crate::body::{Body, MAX_CONSTRAINTS, Solid};
use crate::optimize::minimise;
use crate::polynomial::dispatch;
use nalgebra::{SVector, Vector3};
use std::ops::ControlFlow;

/// Distance of two bodies with its proof, lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct Distance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; 0 when the bodies are not proven apart.
    pub lower: f64,
    /// Proven upper bound, attained by the witnesses; 0 on overlap.
    pub upper: f64,
    /// A point of the first body.
    pub witness_a: Vector3<f64>,
    /// A point of the second body; on overlap the same common point.
    pub witness_b: Vector3<f64>,
    /// Unit normal from the second body to the first; none on overlap.
    pub normal: Option<Vector3<f64>>,
    /// Constraints of the first body, or of its part, that the answer rests on, with multipliers: `-n = Σ λ_i ∇g_i`; none on overlap.
    pub active_a: ActiveConstraints,
    /// Constraints of the second body, or of its part, that the answer rests on: `n = Σ λ_i ∇g_i`; none on overlap.
    pub active_b: ActiveConstraints,
    /// Which part of each solid the answer is about: positions in [`Solid::parts`], 0 for single bodies.
    pub parts: [u16; 2],
    /// Whether another pair of parts may be as near, their brackets meeting: normal, witnesses and gradients may then jump.
    /// Never for single bodies, nor on overlap.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl Default for Distance {
    /// What is known of any two bodies: a place for an answer.
    fn default() -> Self {
        Self {
            status: Status::BracketWide,
            lower: 0.0,
            upper: f64::INFINITY,
            witness_a: Vector3::zeros(),
            witness_b: Vector3::zeros(),
            normal: None,
            active_a: ActiveConstraints::default(),
            active_b: ActiveConstraints::default(),
            parts: [0, 0],
            tied: false,
            iterations: 0,
        }
    }
}

impl Distance {
    /// The answer: the middle of the bracket.
    pub fn value(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// Derivatives with respect to the twists of the first and of the second body at the poses the distance was asked for
    /// (envelope theorem: the witnesses count as fixed to their bodies). None unless the bodies are proven apart: at contact
    /// the distance has no gradient, which is what [`super::signed_distance`] is for.
    pub fn gradients(&self, pose_a: &Pose, pose_b: &Pose) -> Option<[Twist; 2]> {
        let n = self.normal.filter(|_| self.lower > 0.0)?;
        Some([
            Twist::of_force(n, &self.witness_a, pose_a.translation()),
            Twist::of_force(-n, &self.witness_b, pose_b.translation()),
        ])
    }
}

/// Euclidean distance between solid `a` at `pose_a` and solid `b` at `pose_b` (body to world), 0 when they touch or overlap;
/// of solids with several parts, that of their closest parts.
///
/// The bracket is as narrow as `options` ask, or the status says that it is not.
/// Far from contact minimises ½|x - y|²; near contact, where that loses its curvature, the point deepest in both bodies
/// decides between overlap and a gap. `warm` is read and then replaced by the hint for the next query of this pair.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel::body::Body;
/// use sublevel::measure::{Options, Pose, WarmStart, distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let answer = distance(&crate_, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((answer.value() - 1.5).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    union::distance(a, pose_a, b, pose_b, &Goal::NARROW, options, warm)
}

/// Distance of two bodies, or as much of it as the goal needs.
pub(super) fn between(
    (a, pose_a): (&Body, &Pose),
    (b, pose_b): (&Body, &Pose),
    goal: &Goal,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    let relation = Apart { pose_a, pose_b, goal, tolerance };
    let mut lost = Lost::after(0);
    let mut proven = None;
    if let Hint::Smooth(trace) = &mut warm.hint {
        match dispatch(Follow { a, b, relation, options, trace }) {
            Ok(found) => proven = Some(found),
            Err(left) => lost = left,
        }
    }
    let still_overlapping = matches!(warm.hint, Hint::Overlap { .. }) && {
        let pair = Pair::new(a, pose_a, b, pose_b);
        matches!(&warm.hint, Hint::Overlap { point_a } if pair.common(&pair.a_to_query(point_a)))
    };
    // Where edges face each other no single constraint is to be followed.
    let smooth = a.is_smooth() && b.is_smooth();
    if proven.is_none() && smooth && !still_overlapping && !lost.touching() && !options.exhausted(lost.rounds) {
        let limit = SEEK_ROUNDS.min(options.max_iterations() - lost.rounds);
        match dispatch(Seek { a, b, relation, from: None, limit, options }) {
            Ok((found, trace)) => {
                *warm = Hint::Smooth(trace).into();
                proven = Some(Proven { rounds: lost.rounds + found.rounds, ..found });
            }
            Err(left) => lost = Lost { rounds: lost.rounds + left.rounds, ..left },
        }
    }
    match proven {
        Some(proven) if proven.width() <= tolerance || goal.met(proven.lower, proven.upper) => {
            proven.answer(a, pose_a, tolerance)
        }
        Some(proven) => sharpened((a, pose_a), (b, pose_b), goal, options, &proven),
        None => {
            let pair = Pair::new(a, pose_a, b, pose_b);
            let mut search = Search::new(&pair, goal, options);
            search.take_over(&lost);
            if !search.decided() {
                search.run(&warm.hint);
            }
            *warm = search.hint();
            search.answer()
        }
    }
}

/// A proven answer that rounding keeps wide, gone on with in twice the precision.
#[cold]
fn sharpened(
    (a, pose_a): (&Body, &Pose),
    (b, pose_b): (&Body, &Pose),
    goal: &Goal,
    options: &Options<'_>,
    proven: &Proven,
) -> Distance {
    let pair = Pair::new(a, pose_a, b, pose_b);
    let mut search = Search::new(&pair, goal, options);
    search.iterations = proven.rounds;
    search.resume(proven);
    search.sharpen();
    search.answer()
}

/// The point of B nearest to A in the query frame and the constraints that are active there; on overlap a common point, and
/// none.
pub(super) fn nearest(
    pair: &Pair<'_>,
    options: &Options<'_>,
    iterations: &mut u32,
) -> (Vector3<f64>, Option<(Active, Active)>) {
    let mut search = Search::new(pair, &Goal::NARROW, options);
    search.iterations = *iterations;
    search.run(&Hint::Cold);
    *iterations = search.iterations;
    (search.y, (search.upper > 0.0).then_some(search.active))
}

/// A solve in progress: the best bracket so far and where it was attained, in query units.
struct Search<'a> {
    pair: &'a Pair<'a>,
    options: &'a Options<'a>,
    tolerance: f64,
    /// In metres, and in query units.
    goals: (&'a Goal, Goal),
    lower: f64,
    upper: f64,
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// Normal of the best lower bound.
    n: Vector3<f64>,
    active: (Active, Active),
    /// Of an answer by continuation.
    trace: Option<Trace>,
    /// Where the lower bound was found, and where Newton's method ended last.
    tried: [Option<DistanceNewton>; 2],
    iterations: u32,
}

/// Below this distance relative to the larger body, ½|x - y|² has little curvature to aim by.
const NEAR: f64 = 1e-3;

/// Below this one it has none that rounding leaves.
const NEAREST: f64 = 1e-7;

/// Share of the way to an interior point that leaves a surface behind.
const DEEPER: f64 = 1e-6;

/// Values above this one are too steep to start from.
const STEEP: f64 = 1e3;

impl<'a> Search<'a> {
    fn new(pair: &'a Pair<'a>, goal: &'a Goal, options: &'a Options<'a>) -> Self {
        let (x, y) = (pair.a.interior, pair.b.interior);
        let n = (x - y).try_normalize(0.0).unwrap_or_else(Vector3::x);
        Self {
            pair,
            options,
            tolerance: pair.tolerance(options.accuracy()),
            goals: (goal, goal.in_units_of(pair.unit())),
            lower: 0.0,
            upper: f64::INFINITY,
            x,
            y,
            n,
            active: (Active::default(), Active::default()),
            trace: None,
            tried: [None; 2],
            iterations: 0,
        }
    }

    /// Whether the bracket is as narrow as asked for.
    fn narrow(&self) -> bool {
        self.upper.is_finite() && self.upper - self.lower <= self.tolerance
    }

    fn done(&self) -> bool {
        self.narrow() || self.goals.1.met(self.lower, self.upper)
    }

    /// Whether the bracket is narrow enough and says on which side of contact the bodies are.
    fn decided(&self) -> bool {
        self.done() && (self.lower > 0.0 || self.upper == 0.0)
    }

    /// Whether the bracket is narrow enough or no more may be done.
    fn ended(&self) -> bool {
        self.done() || self.options.exhausted(self.iterations)
    }

    fn run(&mut self, hint: &Hint) {
        if self.options.exhausted(self.iterations) {
            // Any pair of points is an answer.
            self.attain(&self.pair.a.interior.clone_owned(), &self.pair.b.interior.clone_owned());
            return;
        }
        match hint {
            Hint::Apart { x_a, y_b, normal_a, active_a, active_b } => {
                let active =
                    (Active::from_bits(*active_a, self.pair.a.len()), Active::from_bits(*active_b, self.pair.b.len()));
                if let (Some(a), Some(b)) = active {
                    self.newton(self.pair.a_to_query(x_a), self.pair.b_to_query(y_b), *normal_a, a, b);
                }
            }
            Hint::Overlap { point_a } => {
                self.common(&self.pair.a_to_query(point_a));
            }
            Hint::Cold
            | Hint::Level { .. }
            | Hint::LevelSmooth(_)
            | Hint::Saturated
            | Hint::Single { .. }
            | Hint::Smooth(_) => {}
        }
        if !self.ended() {
            self.outlined();
        }
        if !self.ended() {
            self.closest(NEAR);
        }
        if !self.ended() && !self.decided() && self.lower < NEAR * self.pair.size() {
            self.contact();
        }
        // Where both are elongated or edged, first order from the deepest point is not close enough.
        if !self.ended() {
            self.closest(NEAREST);
        }
        // A bracket that holds 0 but is not sure of contact is as wide as rounding left it.
        let unsure = self.narrow() && !self.decided() && !self.options.exhausted(self.iterations);
        if !self.ended() || unsure {
            self.sharpen();
        }
        // From points this near, values are no longer too steep to start from.
        if !self.ended() && self.lower == 0.0 {
            self.contact();
        }
    }

    /// Newton's method from where the outlines are nearest, with the constraints that are active there. Where two sides are all but
    /// parallel that is anywhere on them, but the corners of one show.
    fn outlined(&mut self) {
        let pair = self.pair;
        let found = approach(pair, &self.n);
        if let Some(v) = found.common {
            // Outlines of bodies with edges lie on their surfaces.
            let deeper = |body: &Posed<'_>| v.lerp(&body.interior, DEEPER);
            if [v, deeper(&pair.a), deeper(&pair.b)].iter().any(|v| self.common(v)) {
                return;
            }
        }
        let Approach { x, y, n, corners, .. } = found;
        if pair.smooth() {
            self.seek(&x, &y, &n);
            return;
        }
        for (x, y) in [(x, y), (x, corners.1), (corners.0, y)] {
            let (a, b) = (Active::near(&pair.a, &x, &-n), Active::near(&pair.b, &y, &n));
            self.newton(x, y, n, a, b);
            if self.ended() || found.common.is_some() {
                return;
            }
        }
    }

    /// Continuation of smooth bodies from two points and a normal.
    fn seek(&mut self, x: &Vector3<f64>, y: &Vector3<f64>, n: &Vector3<f64>) {
        let (pair, options) = (self.pair, self.options);
        if options.exhausted(self.iterations) {
            return;
        }
        let (pose_a, pose_b) = pair.poses();
        let relation = Apart { pose_a, pose_b, goal: self.goals.0, tolerance: self.tolerance * pair.unit() };
        let center = pair.a.body.normalization().center;
        let from_center = |v: &Vector3<f64>| (pair.to_a(v) - center).into();
        let from = Some(Start { x: from_center(x), y: from_center(y), n: (*n).into() });
        let limit = SEEK_ROUNDS.min(options.max_iterations() - self.iterations);
        match dispatch(Seek { a: pair.a.body, b: pair.b.body, relation, from, limit, options }) {
            Ok((proven, trace)) => {
                self.iterations += proven.rounds;
                self.resume(&proven);
                self.trace = Some(trace);
                if !self.done() {
                    self.sharpen();
                }
            }
            Err(lost) => self.take_over(&lost),
        }
    }

    /// Goes on from what continuation has left: near contact in twice the precision.
    fn take_over(&mut self, lost: &Lost) {
        self.iterations += lost.rounds;
        let pair = self.pair;
        let center = pair.a.body.normalization().center;
        let to_query = |v: V3<f64>| pair.a_to_query(&(center + Vector3::from(v)));
        if lost.middle.is_some_and(|middle| self.common(&to_query(middle))) {
            return;
        }
        if let Some(grazing) = &lost.grazing {
            self.resume(grazing);
            self.sharpen();
        }
    }

    /// Takes the bracket of continuation and where it was attained.
    fn resume(&mut self, proven: &Proven) {
        let pair = self.pair;
        let (unit, center) = (pair.unit(), pair.a.body.normalization().center);
        let to_query = |v: V3<f64>| pair.a_to_query(&(center + Vector3::from(v)));
        let [a, b] = [0, 1].map(|i| {
            let mut active = Active::default();
            active.push(usize::from(proven.active[i]));
            active.multiplier[0] = proven.multipliers[i] / unit;
            active
        });
        let (x, y, n) = (to_query(proven.x), to_query(proven.y), Vector3::from(proven.n));
        (self.lower, self.upper) = (proven.lower / unit, proven.upper / unit);
        (self.x, self.y, self.n, self.active) = (x, y, n, (a, b));
        self.tried[0] = Some(DistanceNewton { x, y, distance: n.dot(&(x - y)), n, a, b });
    }

    /// Goes on in twice the precision where rounding keeps the bracket wide.
    fn sharpen(&mut self) {
        let pair = self.pair;
        let sharp = SharpPair::new(pair);
        for start in self.tried.into_iter().flatten() {
            let left = self.options.max_iterations() - self.iterations.min(self.options.max_iterations());
            let steps = sharp.distance(&start, left, |found| {
                if self.raise(found.lower, &found.n) {
                    self.active = found.active;
                }
                if found.upper < self.upper {
                    (self.upper, self.x, self.y) = (found.upper, found.x, found.y);
                }
                self.decided() || self.options.stopped()
            });
            self.iterations += steps;
            if self.decided() || self.options.exhausted(self.iterations) {
                return;
            }
        }
    }

    /// Interior-point method on ½|x - y|², with Newton's method tried as soon as it shows the active constraints; ends at
    /// distances below `near` times the size.
    fn closest(&mut self, near: f64) {
        let (start_x, start_y) = (self.pair.a.interior, self.pair.b.interior);
        let mut v = SVector::<f64, 6>::zeros();
        v.fixed_rows_mut::<3>(0).copy_from(&start_x);
        v.fixed_rows_mut::<3>(3).copy_from(&start_y);
        if self.common(&((start_x + start_y) * 0.5)) {
            return;
        }
        self.attain(&start_x, &start_y);
        if self.done() {
            return;
        }
        let first = 0.5 * (start_x - start_y).norm_squared();
        let near = near * self.pair.size();
        let mut attempt = 1e-1;
        minimise(&Closest(self.pair), &mut v, first.max(1e-6), |iterate| {
            self.iterations += 1;
            let (x, y) = points(iterate.v);
            let apart = (x - y).norm();
            let value = 0.5 * apart * apart;
            // A midpoint inside both settles overlaps within the first steps.
            if apart < self.pair.size() && self.common(&((x + y) * 0.5)) {
                return ControlFlow::Break(());
            }
            // Early iterates, still outside the bodies, may meet by chance.
            if apart < near && iterate.gap < near {
                self.attain(&x, &y);
                return ControlFlow::Break(());
            }
            if iterate.gap < attempt * value {
                attempt = (iterate.gap / value) * 1e-2;
                let (of_a, of_b) = split(self.pair, iterate.multipliers, 1.0 / apart);
                let n = (x - y) / apart;
                self.bound(&x, &y, &of_a, &of_b);
                self.attain(&x, &y);
                if !self.done() {
                    self.newton(x, y, n, Active::from_multipliers(&of_a), Active::from_multipliers(&of_b));
                }
                if self.done() || attempt < 1e-18 {
                    return ControlFlow::Break(());
                }
            }
            if self.options.exhausted(self.iterations) {
                // What is known by now is the answer.
                self.attain(&x, &y);
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
    }

    /// The point deepest in both bodies: inside both, it proves overlap; else its multipliers show the normal.
    fn contact(&mut self) {
        let pair = self.pair;
        let depth = |v: &Vector3<f64>| {
            let values = (0..pair.a.len()).map(|i| pair.a.jet(i, v).value);
            values.chain((0..pair.b.len()).map(|i| pair.b.jet(i, v).value)).fold(f64::MIN, f64::max)
        };
        // Far outside a small body its values would hide all else.
        let starts = [(self.x + self.y) * 0.5, self.x, self.y];
        let start = if depth(&starts[0]) < STEEP { starts[0] } else { least_of(starts, depth) };
        let first = depth(&start) + 0.5;
        let mut v = SVector::from([start.x, start.y, start.z, first]);
        let mut attempt = 1e-1;
        let program = Level { pair, both: true, scale: 1.0 };
        minimise(&program, &mut v, 1.0, |iterate| {
            self.iterations += 1;
            let x = iterate.v.xyz();
            if iterate.v[3] < 1.0 && self.common(&x) {
                return ControlFlow::Break(());
            }
            if iterate.gap < attempt {
                attempt = iterate.gap * 1e-2;
                let (of_a, of_b) = split(pair, iterate.multipliers, 1.0);
                let (u, w) = (gradient(&pair.a, &x, &of_a), gradient(&pair.b, &x, &of_b));
                if u.norm() > 0.0 && w.norm() > 0.0 {
                    let n = (w / w.norm() - u / u.norm()).try_normalize(0.0).unwrap_or(self.n);
                    let (x_a, y_b) = (pair.a.enter(&x, &n), pair.b.enter(&x, &-n));
                    self.bound(&x, &x, &of_a, &of_b);
                    self.attain(&x_a, &y_b);
                    if !self.done() {
                        self.newton(x_a, y_b, n, Active::from_multipliers(&of_a), Active::from_multipliers(&of_b));
                    }
                }
            }
            let ended = self.decided() || attempt < 1e-18 || self.options.exhausted(self.iterations);
            if ended { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    fn newton(&mut self, x: Vector3<f64>, y: Vector3<f64>, n: Vector3<f64>, a: Active, b: Active) {
        if ![x, y, n].iter().all(|v| v.iter().all(|value| value.is_finite())) {
            return;
        }
        let distance = n.dot(&(x - y)).max(0.0);
        let mut newton = DistanceNewton { x, y, distance, n, a, b };
        let left = self.options.max_iterations() - self.iterations.min(self.options.max_iterations());
        let steps = newton.run(self.pair, left, |at| {
            // Stationary in an overlap.
            if at.distance <= 0.0 {
                return self.common(&((at.x + at.y) * 0.5));
            }
            let (of_a, of_b) = (at.a.multipliers(), at.b.multipliers());
            let lower = distance_lower(self.pair, &at.x, &at.y, &at.n, &of_a, &of_b);
            let raised = self.raise(lower, &at.n);
            if raised {
                self.tried[0] = Some(*at);
            }
            if raised | self.attain(&at.x, &at.y) {
                self.active = (at.a, at.b);
            }
            self.done() || self.options.exhausted(0)
        });
        self.iterations += steps;
        self.tried[1] = Some(newton);
    }

    /// Improves the lower bound with multipliers for unit normals, trying each body's idea of the normal.
    fn bound(&mut self, x: &Vector3<f64>, y: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) {
        let (u, w) = (gradient(&self.pair.a, x, of_a), gradient(&self.pair.b, y, of_b));
        let (lu, lw) = (u.norm(), w.norm());
        if !(lu > 0.0 && lw > 0.0) {
            return;
        }
        let (of_a, of_b) = (of_a.map(|m| m / lu), of_b.map(|m| m / lw));
        for n in [-u / lu, w / lw] {
            if self.raise(distance_lower(self.pair, x, y, &n, &of_a, &of_b), &n) {
                let (a, b) = (Active::from_forces(&self.pair.a, x, &of_a), Active::from_forces(&self.pair.b, y, &of_b));
                self.tried[0] = Some(DistanceNewton { x: *x, y: *y, distance: n.dot(&(x - y)), n, a, b });
            }
        }
    }

    /// Takes a lower bound and its normal if it is the best so far.
    fn raise(&mut self, lower: f64, n: &Vector3<f64>) -> bool {
        let better = lower > self.lower;
        if better {
            (self.lower, self.n) = (lower, *n);
        }
        better
    }

    /// Pulls trial points into their bodies and takes them if they are the closest so far.
    fn attain(&mut self, x: &Vector3<f64>, y: &Vector3<f64>) -> bool {
        let (Some(x), Some(y)) = (self.pair.a.pull_in(x), self.pair.b.pull_in(y)) else { return false };
        let upper = distance_upper(self.pair, &x, &y);
        let better = upper < self.upper;
        if better {
            (self.upper, self.x, self.y) = (upper, x, y);
        }
        better
    }

    /// Whether v is proven to lie in both bodies; if so the answer is 0.
    fn common(&mut self, v: &Vector3<f64>) -> bool {
        let both = self.pair.common(v);
        if both {
            (self.lower, self.upper, self.x, self.y) = (0.0, 0.0, *v, *v);
        }
        both
    }

    fn hint(&self) -> WarmStart {
        if self.upper == 0.0 {
            Hint::Overlap { point_a: self.pair.to_a(&self.x) }.into()
        } else if let Some(trace) = self.trace() {
            Hint::Smooth(trace).into()
        } else {
            WarmStart::apart(self.pair, &self.x, &self.y, &self.n, self.active.0.bits(), self.active.1.bits())
        }
    }

    /// The answer as a start for continuation, if one constraint of each body is active.
    fn trace(&self) -> Option<Trace> {
        if self.trace.is_some() {
            return self.trace;
        }
        let active = [self.active.0.single()?, self.active.1.single()?];
        let (x, y) = (self.pair.to_a(&self.x), self.pair.to_b(&self.y));
        Some(Trace::new(self.pair.a.body, &x, self.pair.b.body, &y, &self.n, active))
    }

    fn answer(&self) -> Distance {
        let unit = self.pair.unit();
        let witness_a = self.pair.to_world(&self.x);
        let (witness_b, normal) = if self.upper == 0.0 {
            (witness_a, None)
        } else {
            let n = if self.lower > 0.0 { self.n } else { self.between_normals() };
            let n = n.try_normalize(0.0).map(|n| self.pair.direction_to_world(&n));
            (self.pair.to_world(&self.y), n)
        };
        Distance {
            status: if self.narrow() { Status::Converged } else { Status::BracketWide },
            lower: self.lower * unit,
            upper: self.upper * unit,
            witness_a,
            witness_b,
            normal,
            active_a: self.active.0.reported(if normal.is_some() { unit } else { 0.0 }),
            active_b: self.active.1.reported(if normal.is_some() { unit } else { 0.0 }),
            parts: [0, 0],
            tied: false,
            iterations: self.iterations,
        }
    }

    /// Halfway between the outward normal of B and the inward one of A at the witnesses: what the normal is where no lower bound
    /// has proven one.
    fn between_normals(&self) -> Vector3<f64> {
        let outward = |body: &Posed<'_>, v: &Vector3<f64>| {
            let jets = (0..body.len()).map(|i| body.jet(i, v));
            let highest = jets.max_by(|p, q| p.value.total_cmp(&q.value));
            highest.and_then(|jet| jet.gradient.try_normalize(0.0)).unwrap_or_default()
        };
        outward(&self.pair.b, &self.y) - outward(&self.pair.a, &self.x)
    }
}

impl Proven {
    fn width(&self) -> f64 {
        self.upper - self.lower
    }

    fn answer(&self, a: &Body, pose_a: &Pose, tolerance: f64) -> Distance {
        let (witness_a, witness_b) = self.witnesses(a, pose_a);
        Distance {
            status: if self.width() <= tolerance { Status::Converged } else { Status::BracketWide },
            lower: self.lower,
            upper: self.upper,
            witness_a,
            witness_b,
            normal: self.normal(pose_a),
            active_a: ActiveConstraints::single(self.active[0], self.multipliers[0]),
            active_b: ActiveConstraints::single(self.active[1], self.multipliers[1]),
            parts: [0, 0],
            tied: false,
            iterations: self.rounds,
        }
    }
}

/// Splits the multipliers of a program's rows into those of A and of B, times `factor`.
pub(super) fn split(pair: &Pair<'_>, rows: &[f64], factor: f64) -> (Multipliers, Multipliers) {
    let (mut of_a, mut of_b) = ([0.0; MAX_CONSTRAINTS], [0.0; MAX_CONSTRAINTS]);
    let (first, second) = rows.split_at(pair.a.len());
    for (to, from) in of_a.iter_mut().zip(first).chain(of_b.iter_mut().zip(second)) {
        *to = from * factor;
    }
    (of_a, of_b)
}

/// Of three points the one of the least value.
fn least_of(points: [Vector3<f64>; 3], value: impl Fn(&Vector3<f64>) -> f64) -> Vector3<f64> {
    points.into_iter().min_by(|p, q| value(p).total_cmp(&value(q))).unwrap_or(points[0])
}

fn gradient(body: &Posed<'_>, v: &Vector3<f64>, multipliers: &Multipliers) -> Vector3<f64> {
    (0..body.len()).map(|i| body.jet(i, v).gradient * multipliers[i]).sum()
}
