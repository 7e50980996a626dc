//! The search for a distance where continuation alone has not proven it: every method in turn, from
//! the cheapest, each of them improving one bracket.

use super::answer::Distance;
use super::deepest::Deepest;
use crate::measure::bounds::culling::across;
use crate::measure::bounds::duality_bounds::{DualTrial, Multipliers, distance_lower, distance_upper};
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::frames::vector::V3;
use crate::measure::options::Options;
use crate::measure::solver::barrier_programs::{Closest, Level, points, split};
use crate::measure::solver::continuation::{Lost, Proven, SEEK_ROUNDS, Seek, Trace};
use crate::measure::solver::initial_guess::Start;
use crate::measure::solver::kkt_newton::{Active, DistanceNewton, Pace, WORTH_A_BRACKET};
use crate::measure::solver::ray_program::{RayStart, ReachNewton};
use crate::measure::solver::refinement::SharpPair;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::support_table_gjk::approach;
use crate::measure::solver::two_point_problem::Apart;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::optimize::{Approach, minimise};
use crate::polynomial::dispatch;
use nalgebra::{SVector, Vector3};
use std::ops::ControlFlow;

/// What has come of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Outcome {
    /// An answer, or the end of what may be spent on one.
    Proven,
    /// A narrower bracket.
    Improved,
    /// Nothing that was not known.
    Failed,
}

/// A solve in progress: the best bracket so far and where it was attained, in query units.
pub(super) struct Search<'a> {
    pair: &'a Pair<'a>,
    options: &'a Options<'a>,
    tolerance: f64,
    /// In metres, and in query units.
    goals: (&'a StopCriterion, StopCriterion),
    lower: f64,
    upper: f64,
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// Normal of the best lower bound.
    n: Vector3<f64>,
    active: (Active, Active),
    /// Whether all of these are of one iterate whose normal is that of the solution.
    aligned: bool,
    /// Of an answer by continuation.
    trace: Option<Trace>,
    /// Where the lower bound was found, and where Newton's method ended last.
    tried: [Option<DistanceNewton>; 2],
    /// Points and normal that active sets began at last.
    active_sets_from: Option<[Vector3<f64>; 3]>,
    iterations: u32,
}

/// Distance relative to the larger body, below which ½|x - y|² has little curvature to aim by. The
/// interior-point method then goes for the deepest point first; larger, it does for bodies that
/// are well apart, which takes time. No test pins it.
const SHORT_DISTANCE: f64 = 1e-3;

/// Distance of the outlines, relative to the larger body, above which the bodies have no point in
/// common to look for.
const FACING: f64 = 0.1;

/// Distance relative to the larger body, below which rounding leaves the interior-point method on
/// ½|x - y|² nothing to aim by, and refinement takes over. No test pins it.
const SHORTEST_DISTANCE: f64 = 1e-7;

/// Distance relative to the larger body below which contact is a matter of how poses are rounded.
const CONTACT: f64 = 1e-18;

/// Most steps towards the point deepest in both bodies.
const MAX_DEEPEST: u32 = 10;

/// Steps of twice the precision for which side of contact a narrow bracket is on: those that find
/// out take half as many.
const UNSURE: u32 = 8;

/// Share of the way to an interior point that leaves a surface behind.
const DEEPER: f64 = 1e-6;

/// Values above this one are too steep to start from.
const STEEP: f64 = 1e3;

impl<'a> Search<'a> {
    /// A search that knows nothing yet, after that many iterations.
    pub(super) fn new(pair: &'a Pair<'a>, goal: &'a StopCriterion, options: &'a Options<'a>, iterations: u32) -> Self {
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
            aligned: false,
            trace: None,
            tried: [None; 2],
            active_sets_from: None,
            iterations,
        }
    }

    /// Whether the bracket is as narrow as asked for.
    fn narrow(&self) -> bool {
        self.upper.is_finite() && self.upper - self.lower <= self.tolerance
    }

    /// Whether nothing is missing but the normal of the solution. Of bodies nearer than what is
    /// asked for contact is as good an answer.
    fn has_to_be_aligned(&self) -> bool {
        let decided = self.goals.1.met(self.lower, self.upper) || !self.goals.0.wants_answer();
        self.narrow() && self.lower > 0.0 && self.upper > self.tolerance && !self.aligned && !decided
    }

    fn done(&self) -> bool {
        self.narrow() || self.goals.1.met(self.lower, self.upper)
    }

    /// Whether the bracket is narrow enough and says on which side of contact the bodies are.
    pub(super) fn decided(&self) -> bool {
        self.done() && (self.lower > 0.0 || self.upper == 0.0)
    }

    /// Whether the distance is too short for any pose of doubles to tell it from contact.
    fn touching(&self) -> bool {
        self.narrow() && self.upper <= CONTACT * self.pair.size()
    }

    /// Whether the bracket is narrow enough or no more may be done.
    fn ended(&self) -> bool {
        self.done() || self.options.exhausted(self.iterations)
    }

    /// The methods in turn, until one has proven the answer.
    pub(super) fn run(&mut self, hint: &Hint) {
        let methods: [fn(&mut Self, &Hint); 5] =
            [Self::continuation, Self::starts, Self::active_sets, Self::interior_points, Self::refinement];
        for method in methods {
            if self.attempt(method, hint) == Outcome::Proven {
                break;
            }
        }
        self.attain_any();
    }

    fn attempt(&mut self, method: fn(&mut Self, &Hint), hint: &Hint) -> Outcome {
        let before = (self.lower, self.upper);
        if !self.options.exhausted(self.iterations) {
            method(self, hint);
        }
        let settled = self.decided() && !self.has_to_be_aligned();
        if settled || self.options.exhausted(self.iterations) {
            Outcome::Proven
        } else if (self.lower, self.upper) == before {
            Outcome::Failed
        } else {
            Outcome::Improved
        }
    }

    /// Newton's method on from the answer before, with its active constraints. Of smooth bodies
    /// that is done before there is a search.
    fn continuation(&mut self, hint: &Hint) {
        let Hint::Apart { x_a, y_b, normal_a, active_a, active_b } = hint else { return };
        let [a, b] = [(active_a, &self.pair.a), (active_b, &self.pair.b)]
            .map(|(active, body)| Active::from_bits(*active, body.len()));
        if let (Some(a), Some(b)) = (a, b) {
            self.newton(self.pair.a_to_query(x_a), self.pair.b_to_query(y_b), *normal_a, a, b);
        }
    }

    /// Newton's method from where the outlines are nearest, with the constraints that are active
    /// there. Where two sides are all but parallel that is anywhere on them, but the corners of one
    /// show.
    fn starts(&mut self, _: &Hint) {
        if !runs(Stage::SupportTables) || self.ended() {
            return;
        }
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
        } else {
            for (k, (x, y)) in [(x, y), (x, corners.1), (corners.0, y)].into_iter().enumerate() {
                let (a, b) = (Active::near(&pair.a, &x, &-n), Active::near(&pair.b, &y, &n));
                self.newton(x, y, n, a, b);
                // The later attempts are from corners, which it finds by itself.
                if k == 0 && !self.ended() {
                    self.along(x, y, n, a, b);
                }
                if self.ended() || found.common.is_some() {
                    break;
                }
            }
        }
        let near = found.common.is_some() || (x - y).norm() < FACING * pair.size();
        if !self.ended() && self.lower == 0.0 && near {
            self.deepest(&found.common.unwrap_or((x + y) * 0.5), &n);
        }
    }

    /// Newton's method for how far apart the bodies are along a normal that is about the right one.
    /// Its steps are those of quadratic programs, which go all the way to the edges of sides that
    /// are tilted by next to nothing.
    fn along(&mut self, x: Vector3<f64>, y: Vector3<f64>, n: Vector3<f64>, a: Active, b: Active) {
        if !runs(Stage::Ray) {
            return;
        }
        let pair = self.pair;
        let Some(mut newton) = ReachNewton::new(pair, RayStart { u: -n, offset: Vector3::zeros(), x, y, n: -n, a, b })
        else {
            return;
        };
        let steps = newton.run(pair, self.options, self.iterations, |at| {
            let scale = 1.0 / at.n.norm();
            let (n, a, b) = (-at.n * scale, at.a.scaled(scale), at.b.scaled(scale));
            let (of_a, of_b) = (a.multipliers(), b.multipliers());
            let trial = DualTrial { x: &at.x, y: &at.y, n: &n, of_a: &of_a, of_b: &of_b };
            let raised = self.raise(distance_lower(pair, &trial), &n);
            if raised {
                let distance = n.dot(&(at.x - at.y));
                self.tried[0] = Some(DistanceNewton { x: at.x, y: at.y, distance, n, a, b });
            }
            if raised | self.attain(&at.x, &at.y) {
                self.active = (a, b);
            }
            self.done()
        });
        self.iterations += steps;
        if !self.ended() && newton.is_near() {
            self.newton(newton.x, newton.y, -newton.n.normalize(), newton.a, newton.b);
        }
    }

    /// The same for bodies with edges from the best points so far, with the constraints that are
    /// active there: from a start the others have diverged.
    fn active_sets(&mut self, _: &Hint) {
        let known = self.lower > 0.0 && self.upper.is_finite();
        if !runs(Stage::Again) || self.pair.smooth() || !known || self.ended() {
            return;
        }
        let (x, y, n) = (self.x, self.y, self.n);
        // From the same points they would end the same.
        if self.active_sets_from.replace([x, y, n]) == Some([x, y, n]) {
            return;
        }
        let (a, b) = (Active::near(&self.pair.a, &x, &-n), Active::near(&self.pair.b, &y, &n));
        self.along(x, y, n, a, b);
    }

    /// Interior-point methods, and active sets from where these have led.
    fn interior_points(&mut self, hint: &Hint) {
        if self.attempt(Self::closest_or_deepest, hint) != Outcome::Proven {
            self.active_sets(hint);
        }
    }

    /// The interior-point method for the distance, near contact for the deepest point.
    fn closest_or_deepest(&mut self, _: &Hint) {
        if !self.ended() {
            self.closest(SHORT_DISTANCE);
        }
        if !self.ended() && !self.decided() && self.lower < SHORT_DISTANCE * self.pair.size() {
            self.contact();
        }
        // Where both are elongated or edged, first order from the deepest point is not close
        // enough.
        if !self.ended() {
            self.closest(SHORTEST_DISTANCE);
        }
    }

    /// Twice the precision, for the bracket and for the side of contact, and Newton's method until
    /// the normal is that of the solution.
    fn refinement(&mut self, _: &Hint) {
        // A bracket that holds 0 but is not sure of contact is as wide as rounding left it.
        let unsure = self.narrow() && !self.decided();
        if unsure && !self.pair.smooth() && runs(Stage::UnsureDeepest) {
            // Edges that reach into a body have brought the points together where the surfaces
            // cross.
            let (v, n) = ((self.x + self.y) * 0.5, self.n);
            self.deepest(&v, &n);
        }
        if !self.ended() || unsure && !self.decided() {
            self.sharpen();
        }
        self.align();
    }

    /// Goes on to the normal of the solution: a bracket that is narrow holds it to about the root
    /// of its width relative to the distance, and near contact to nothing.
    fn align(&mut self) {
        if !runs(Stage::Alignment) || !self.has_to_be_aligned() || self.options.exhausted(self.iterations) {
            return;
        }
        let (x, y, n) = (self.x, self.y, self.n);
        let near = || (Active::near(&self.pair.a, &x, &-n), Active::near(&self.pair.b, &y, &n));
        let (x, y, n, (a, b)) = self.tried[0].map_or_else(|| (x, y, n, near()), |at| (at.x, at.y, at.n, (at.a, at.b)));
        self.newton(x, y, n, a, b);
        // So near to each other doubles may not show the normal.
        if self.has_to_be_aligned() && self.lower < SHORTEST_DISTANCE * self.pair.size() {
            self.sharpen();
        }
    }

    /// A point in A's frame from its normalization's centre on, metres.
    fn centered(&self, v: &Vector3<f64>) -> [f64; 3] {
        (self.pair.to_a(v) - self.pair.a.body.normalization().center).into()
    }

    /// Continuation of smooth bodies from two points and a normal.
    fn seek(&mut self, x: &Vector3<f64>, y: &Vector3<f64>, n: &Vector3<f64>) {
        let (pair, options) = (self.pair, self.options);
        if !runs(Stage::Seek) || options.exhausted(self.iterations) {
            return;
        }
        let (pose_a, pose_b) = pair.poses();
        let relation = Apart { pose_a, pose_b, goal: self.goals.0, tolerance: self.tolerance * pair.unit() };
        let from = Some(Start { x: self.centered(x), y: self.centered(y), n: (*n).into() });
        let most = SEEK_ROUNDS.min(options.max_iterations() - self.iterations);
        match dispatch(Seek { a: pair.a.body, b: pair.b.body, relation, from, most, options }) {
            Ok((proven, trace)) => {
                self.iterations += proven.rounds;
                self.resume(&proven);
                // As it was taken as proven.
                self.aligned = true;
                self.trace = Some(trace);
                if !self.done() {
                    self.sharpen();
                }
            }
            Err(lost) => {
                self.iterations += lost.rounds;
                self.take_over(&lost);
            }
        }
    }

    /// Goes on from what continuation has left: near contact in twice the precision.
    pub(super) fn take_over(&mut self, lost: &Lost) {
        let pair = self.pair;
        let center = pair.a.body.normalization().center;
        let to_query = |v: V3<f64>| pair.a_to_query(&(center + Vector3::from(v)));
        if lost.middle.is_some_and(|middle| self.common(&to_query(middle))) {
            return;
        }
        // Bodies of one shape on top of each other touch all over: a bad hint finds that, and not
        // that they overlap.
        if lost.touching() && self.common(&pair.a.interior.lerp(&pair.b.interior, 0.5)) {
            return;
        }
        if let Some(grazing) = &lost.grazing {
            self.resume(grazing);
            self.sharpen();
        }
    }

    /// Takes what is better in the bracket of continuation, and where that ended as a start.
    pub(super) fn resume(&mut self, proven: &Proven) {
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
        let raised = self.raise(proven.lower / unit, &n);
        if raised | self.take(proven.upper / unit, x, y) {
            self.active = (a, b);
        }
        self.tried[0] = Some(DistanceNewton { x, y, distance: n.dot(&(x - y)), n, a, b });
    }

    /// The interior points as an answer where nothing better was attained: early ends leave a
    /// bracket, too.
    pub(super) fn attain_any(&mut self) {
        let (pair, (pose_a, pose_b)) = (self.pair, self.pair.poses());
        if self.upper.is_infinite() {
            // Proven in the bodies' own frames: however far away bodies are, this one is finite.
            let (of_a, of_b) = (pair.a.body.interior_point(), pair.b.body.interior_point());
            let (_, apart, error) = across((pose_a, of_a), (pose_b, of_b));
            let upper = (apart + error) * (1.0 + f64::EPSILON) / pair.unit();
            self.take(upper, pair.a.interior, pair.b.interior);
        }
    }

    /// Goes on in twice the precision where rounding keeps the bracket wide.
    pub(super) fn sharpen(&mut self) {
        if !runs(Stage::Refinement) {
            return;
        }
        let pair = self.pair;
        let sharp = SharpPair::new(pair);
        // Once each: from the same start it would end the same.
        while let Some(start) = self.tried.iter_mut().find_map(Option::take) {
            let left = self.options.max_iterations() - self.iterations.min(self.options.max_iterations());
            let left = if self.narrow() && self.goals.0.is_narrow() { left.min(UNSURE) } else { left };
            let steps = sharp.distance(&start, left, |found| {
                if self.raise(found.lower, &found.n) {
                    self.active = found.active;
                }
                self.take(found.upper, found.x, found.y);
                if found.aligned {
                    self.align_with(found.upper, [found.x, found.y, found.n], found.active);
                }
                self.decided() && !self.has_to_be_aligned() || self.touching() || self.options.stopped()
            });
            self.iterations += steps;
            let ended = self.decided() && !self.has_to_be_aligned() || self.touching();
            if ended || self.options.exhausted(self.iterations) {
                return;
            }
        }
    }

    /// Interior-point method on ½|x - y|², with Newton's method tried as soon as it shows the
    /// active constraints; ends at distances below `near` times the size.
    fn closest(&mut self, near: f64) {
        if !runs(Stage::InteriorDistance) {
            return;
        }
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

    /// The point deepest in both bodies, by Newton's method from a point and a normal.
    fn deepest(&mut self, v: &Vector3<f64>, n: &Vector3<f64>) {
        if !runs(Stage::Deepest) {
            return;
        }
        let pair = self.pair;
        let (a, b) = (Active::near(&pair.a, v, &-n), Active::near(&pair.b, v, n));
        let mut deepest = Deepest::new(*v, self.depth(v), a, b);
        let mut pace = Pace::FIRST;
        for _ in 0..MAX_DEEPEST {
            if self.options.exhausted(self.iterations) {
                return;
            }
            self.iterations += 1;
            let Some(length) = deepest.step(pair) else { return };
            if deepest.s < 1.0 && self.common(&deepest.x) {
                return;
            }
            if pace.ends_with(length) || length < WORTH_A_BRACKET && deepest.s > 1.0 {
                self.part(&deepest.x, &deepest.a.multipliers(), &deepest.b.multipliers());
                return;
            }
        }
    }

    /// Newton's method for the distance from a point between both bodies, with multipliers of the
    /// constraints that are largest there.
    fn part(&mut self, v: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) {
        let pair = self.pair;
        let (u, w) = (pair.a.weighted_gradient(v, of_a), pair.b.weighted_gradient(v, of_b));
        if !(u.norm() > 0.0 && w.norm() > 0.0) {
            return;
        }
        let n = (w / w.norm() - u / u.norm()).try_normalize(0.0).unwrap_or(self.n);
        let (x, y) = (pair.a.enter(v, &n), pair.b.enter(v, &-n));
        self.bound(v, v, of_a, of_b);
        self.attain(&x, &y);
        if !self.done() {
            self.newton(x, y, n, Active::from_multipliers(of_a), Active::from_multipliers(of_b));
        }
    }

    /// The largest constraint of both bodies.
    fn depth(&self, v: &Vector3<f64>) -> f64 {
        let pair = self.pair;
        let values = (0..pair.a.len()).map(|i| pair.a.jet(i, v).value);
        values.chain((0..pair.b.len()).map(|i| pair.b.jet(i, v).value)).fold(f64::MIN, f64::max)
    }

    /// The point deepest in both bodies, by the interior-point method: inside both, it proves
    /// overlap; else its multipliers show the normal.
    fn contact(&mut self) {
        if !runs(Stage::InteriorLevel) {
            return;
        }
        let pair = self.pair;
        // Far outside a small body its values would hide all else.
        let starts = [(self.x + self.y) * 0.5, self.x, self.y];
        let middling = self.depth(&starts[0]) < STEEP;
        let start = if middling { starts[0] } else { least_of(starts, |v| self.depth(v)) };
        let first = self.depth(&start) + 0.5;
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
                self.part(&x, &of_a, &of_b);
            }
            let ended = self.decided() || attempt < 1e-18 || self.options.exhausted(self.iterations);
            if ended { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    fn newton(&mut self, x: Vector3<f64>, y: Vector3<f64>, n: Vector3<f64>, a: Active, b: Active) {
        if !runs(Stage::Newton) || ![x, y, n].iter().all(|v| v.iter().all(|value| value.is_finite())) {
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
            let trial = DualTrial { x: &at.x, y: &at.y, n: &at.n, of_a: &of_a, of_b: &of_b };
            let lower = distance_lower(self.pair, &trial);
            let raised = self.raise(lower, &at.n);
            if raised {
                self.tried[0] = Some(*at);
            }
            if raised | self.attain(&at.x, &at.y) {
                self.active = (at.a, at.b);
            }
            let ended = if self.has_to_be_aligned() { self.adopt(at) } else { self.done() };
            ended || self.options.stopped()
        });
        self.iterations += steps;
        self.tried[1] = Some(newton);
    }

    /// Takes the points and the normal of an iterate if that is the one of the solution, and the
    /// bracket stays narrow; whether it is.
    fn adopt(&mut self, at: &DistanceNewton) -> bool {
        let pair = self.pair;
        if !at.is_aligned(pair) {
            return false;
        }
        let (Some(x), Some(y)) = (pair.a.move_inside(&at.x), pair.b.move_inside(&at.y)) else { return false };
        self.align_with(distance_upper(pair, &x, &y), [x, y, at.n], (at.a, at.b))
    }

    fn align_with(&mut self, upper: f64, [x, y, n]: [Vector3<f64>; 3], active: (Active, Active)) -> bool {
        let narrow = upper - self.lower <= self.tolerance;
        if narrow {
            (self.upper, self.x, self.y, self.n, self.active, self.aligned) = (upper, x, y, n, active, true);
        }
        narrow
    }

    /// Improves the lower bound with multipliers for unit normals, trying each body's idea of the
    /// normal.
    fn bound(&mut self, x: &Vector3<f64>, y: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) {
        let (u, w) = (self.pair.a.weighted_gradient(x, of_a), self.pair.b.weighted_gradient(y, of_b));
        let (lu, lw) = (u.norm(), w.norm());
        if !(lu > 0.0 && lw > 0.0) {
            return;
        }
        let (of_a, of_b) = (of_a.map(|m| m / lu), of_b.map(|m| m / lw));
        for n in [-u / lu, w / lw] {
            let trial = DualTrial { x, y, n: &n, of_a: &of_a, of_b: &of_b };
            if self.raise(distance_lower(self.pair, &trial), &n) {
                let (a, b) = (
                    Active::from_weighted_multipliers(&self.pair.a, x, &of_a),
                    Active::from_weighted_multipliers(&self.pair.b, y, &of_b),
                );
                self.tried[0] = Some(DistanceNewton { x: *x, y: *y, distance: n.dot(&(x - y)), n, a, b });
            }
        }
    }

    /// Takes a lower bound and its normal if it is the best so far.
    fn raise(&mut self, lower: f64, n: &Vector3<f64>) -> bool {
        let better = lower > self.lower;
        if better {
            (self.lower, self.n, self.aligned) = (lower, *n, false);
        }
        better
    }

    /// Pulls trial points into their bodies and takes them if they are the closest so far.
    fn attain(&mut self, x: &Vector3<f64>, y: &Vector3<f64>) -> bool {
        let (Some(x), Some(y)) = (self.pair.a.move_inside(x), self.pair.b.move_inside(y)) else { return false };
        self.take(distance_upper(self.pair, &x, &y), x, y)
    }

    /// Takes an upper bound and the points that attain it if it is the best so far.
    fn take(&mut self, upper: f64, x: Vector3<f64>, y: Vector3<f64>) -> bool {
        let better = upper < self.upper;
        if better {
            (self.upper, self.x, self.y, self.aligned) = (upper, x, y, false);
        }
        better
    }

    /// Whether v is proven to lie in both bodies; if so the answer is 0.
    pub(super) fn common(&mut self, v: &Vector3<f64>) -> bool {
        let both = self.pair.common(v);
        if both {
            (self.lower, self.upper, self.x, self.y) = (0.0, 0.0, *v, *v);
        }
        both
    }

    pub(super) fn iterations(&self) -> u32 {
        self.iterations
    }

    /// The nearest point of B and the constraints that are active there; on overlap a common point,
    /// and none.
    pub(super) fn nearest(&self) -> (Vector3<f64>, Option<(Active, Active)>) {
        (self.y, (self.upper > 0.0).then_some(self.active))
    }

    pub(super) fn hint(&self) -> WarmStart {
        if self.upper == 0.0 {
            Hint::Overlap { point_a: self.pair.to_a(&self.x) }.into()
        } else if let Some(trace) = self.trace() {
            Hint::Smooth(trace).into()
        } else {
            WarmStart::apart(self.pair, [&self.x, &self.y, &self.n], &self.active)
        }
    }

    /// The answer as a start for continuation, if one constraint of each body is active.
    fn trace(&self) -> Option<Trace> {
        if self.trace.is_some() {
            return self.trace;
        }
        let active = [self.active.0.single()?, self.active.1.single()?];
        let (pair, (pose_a, pose_b)) = (self.pair, self.pair.poses());
        let places = [self.centered(&self.x), self.centered(&self.y), self.n.into()];
        Some(Trace::of_distance((pair.a.body, pose_a), (pair.b.body, pose_b), places, active))
    }

    pub(super) fn answer(&self) -> Distance {
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
            status: Status::of(self.narrow()),
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

    /// Halfway between the outward normal of B and the inward one of A at the witnesses: what the
    /// normal is where no lower bound has proven one.
    fn between_normals(&self) -> Vector3<f64> {
        let outward = |body: &Posed<'_>, v: &Vector3<f64>| {
            let jets = (0..body.len()).map(|i| body.jet(i, v));
            let highest = jets.max_by(|p, q| p.value.total_cmp(&q.value));
            highest.and_then(|jet| jet.gradient.try_normalize(0.0)).unwrap_or_default()
        };
        outward(&self.pair.b, &self.y) - outward(&self.pair.a, &self.x)
    }
}

/// Of three points the one of the least value.
fn least_of(points: [Vector3<f64>; 3], value: impl Fn(&Vector3<f64>) -> f64) -> Vector3<f64> {
    points.into_iter().min_by(|p, q| value(p).total_cmp(&value(q))).unwrap_or(points[0])
}
