//! The search for a distance where continuation alone has not proven it: every method in turn, from
//! the cheapest, each of them improving one bracket.
//!
//! `incumbent` keeps the bracket, `interior` has the interior-point methods, `result` the answer.

mod incumbent;
mod interior;
mod result;

use crate::measure::bounds::culling::across;
use crate::measure::bounds::duality_bounds::{DualTrial, distance_lower};
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::frames::vector::V3;
use crate::measure::options::Options;
use crate::measure::solver::continuation::{Lost, Seek, Trace};
use crate::measure::solver::initial_guess::Start;
use crate::measure::solver::kkt_newton::{Active, DistanceNewton};
use crate::measure::solver::ray_program::{RayStart, ReachNewton};
use crate::measure::solver::refinement::RefinedPair;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::support_table_gjk::approach;
use crate::measure::solver::tangent_newton::{ALIGNED, PATIENCE, SEEK_ROUNDS};
use crate::measure::solver::two_point_problem::Apart;
use crate::measure::warm::Hint;
use crate::optimize::Approach;
use crate::polynomial::dispatch;
use nalgebra::Vector3;

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
pub(in crate::measure::distance) struct Search<'a> {
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

/// Distance relative to the larger body, dimensionless, below which `½ |x - y|²` has too little
/// curvature for the interior-point method, which then computes the deepest point first.
///
/// A larger value does so for bodies that are well apart, which takes time; a smaller one leaves
/// near contacts to an ill-conditioned program. No test pins it: the answer comes from another
/// method then.
const SHORT_DISTANCE: f64 = 1e-3;

/// Distance relative to the larger body, dimensionless, below which rounding determines the
/// gradient of `½ |x - y|²`, and refinement takes over from the interior-point method.
///
/// A larger value refines what doubles can solve, a smaller one iterates on rounding. It changes
/// time only; no test pins it.
const SHORTEST_DISTANCE: f64 = 1e-7;

/// Share of the way to an interior point, dimensionless, that moves a point off a surface into the
/// body.
///
/// Values on a surface round at 1e-16: a smaller share does not leave the rounding of thin bodies,
/// a larger one leaves the other body where the overlap is slim. Exercised by
/// `bodies_on_top_of_their_like_overlap_whatever_the_hint`.
const DEEPER: f64 = 1e-6;

impl<'a> Search<'a> {
    /// A search without a bracket yet, after that many iterations.
    pub(in crate::measure::distance) fn new(
        pair: &'a Pair<'a>,
        goal: &'a StopCriterion,
        options: &'a Options<'a>,
        iterations: u32,
    ) -> Self {
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

    /// The methods in turn, until one has proven the answer.
    pub(in crate::measure::distance) fn run(&mut self, hint: &Hint) {
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
                // The later attempts start from corners, which the ray program finds as well.
                if k == 0 && !self.ended() {
                    self.along(x, y, n, a, b);
                }
                if self.ended() || found.common.is_some() {
                    break;
                }
            }
        }
        // Support tables are off by a few percent of a body.
        let near = found.common.is_some() || (x - y).norm() < 0.1 * pair.size();
        if !self.ended() && self.lower == 0.0 && near {
            self.deepest(&found.common.unwrap_or((x + y) * 0.5), &n);
        }
    }

    /// Newton's method for how far apart the bodies are along a normal that is about the right one.
    /// Its steps are those of quadratic programs, which go all the way to the edges of sides that
    /// are nearly parallel.
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

    /// Double-double arithmetic, for the bracket and for the side of contact, and Newton's method
    /// until the normal is that of the solution.
    fn refinement(&mut self, _: &Hint) {
        // A bracket that contains 0 but is not sure of contact is as wide as rounding left it.
        let unsure = self.narrow() && !self.decided();
        if unsure && !self.pair.smooth() && runs(Stage::UnsureDeepest) {
            // Edges that reach into a body have brought the points together where the surfaces
            // cross.
            let (v, n) = ((self.x + self.y) * 0.5, self.n);
            self.deepest(&v, &n);
        }
        if unsure && !self.decided() && self.tried[0].is_none() {
            // No lower bound was found anywhere: at the deepest point there may be one.
            self.tried[0] = self.at_witnesses();
        }
        if !self.ended() || unsure && !self.decided() {
            self.refine();
        }
        self.align();
    }

    /// The best points so far as an iterate, each on the surface of its body as far as doubles show
    /// that; none where the active constraints do not push along the normal.
    fn at_witnesses(&self) -> Option<DistanceNewton> {
        let Self { pair, x, y, n, .. } = *self;
        let (mut a, mut b) = (Active::near(&pair.a, &x, &-n), Active::near(&pair.b, &y, &n));
        let (x, y) = (on_surface(&pair.a, &a, x), on_surface(&pair.b, &b, y));
        // Points of surfaces that cross may both be outside of the other body: their middle stands
        // for both.
        let (x, y) = if n.dot(&(x - y)) < 0.0 { ((x + y) * 0.5, (x + y) * 0.5) } else { (x, y) };
        let fits = a.fit(&pair.a, &x, &-n) && b.fit(&pair.b, &y, &n);
        fits.then(|| DistanceNewton { x, y, distance: n.dot(&(x - y)), n, a, b })
    }

    /// Goes on to the normal of the solution: a bracket that is narrow determines it to about the
    /// root of its width relative to the distance, and near contact to nothing.
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
            self.refine();
        }
    }

    /// Continuation of smooth bodies from two points and a normal.
    fn seek(&mut self, x: &Vector3<f64>, y: &Vector3<f64>, n: &Vector3<f64>) {
        let (pair, options) = (self.pair, self.options);
        if !runs(Stage::Seek) || options.exhausted(self.iterations) {
            return;
        }
        let (pose_a, pose_b) = pair.poses();
        let tolerance = self.tolerance * pair.unit();
        let relation = Apart { pose_a, pose_b, goal: self.goals.0, tolerance, angle: ALIGNED, facing: None };
        let from = Some(Start { x: self.centered(x), y: self.centered(y), n: (*n).into() });
        let most = SEEK_ROUNDS.min(options.max_iterations() - self.iterations);
        let mut trace = Trace::default();
        match dispatch(Seek { a: pair.a.body, b: pair.b.body, relation, from, most, options, trace: &mut trace }) {
            Ok(proven) => {
                self.iterations += proven.rounds;
                self.resume(&proven);
                // As it was taken as proven.
                self.aligned = true;
                self.trace = Some(trace);
                if !self.done() {
                    self.refine();
                }
            }
            Err(lost) => {
                self.iterations += lost.rounds;
                self.take_over(&lost);
            }
        }
    }

    /// Goes on from what continuation has left: near contact in double-double arithmetic.
    pub(in crate::measure::distance) fn take_over(&mut self, lost: &Lost) {
        let pair = self.pair;
        let center = pair.a.body.normalization().center;
        let to_query = |v: V3<f64>| pair.a_to_query(&(center + Vector3::from(v)));
        if lost.common.is_some_and(|common| self.common(&to_query(common.v))) {
            return;
        }
        if let Some(lower) = lost.parted {
            let n = self.n;
            self.raise(lower / pair.unit(), &n);
            return;
        }
        // Bodies of one shape on top of each other touch all over: a bad hint finds that, and not
        // that they overlap.
        if lost.touching() && self.common(&pair.a.interior.lerp(&pair.b.interior, 0.5)) {
            return;
        }
        if let Some(grazing) = &lost.grazing {
            self.resume(grazing);
            self.refine();
        }
    }

    /// The interior points as an answer where nothing better was attained: early ends leave a
    /// bracket, too.
    pub(in crate::measure::distance) fn attain_any(&mut self) {
        let (pair, (pose_a, pose_b)) = (self.pair, self.pair.poses());
        if self.upper.is_infinite() {
            // Proven in the bodies' own frames: however far away bodies are, this one is finite.
            let (of_a, of_b) = (pair.a.body.interior_point(), pair.b.body.interior_point());
            let (_, apart, error) = across((pose_a, of_a), (pose_b, of_b));
            let upper = (apart + error) * (1.0 + f64::EPSILON) / pair.unit();
            self.take(upper, pair.a.interior, pair.b.interior);
        }
    }

    /// Goes on in double-double arithmetic where rounding keeps the bracket wide.
    pub(in crate::measure::distance) fn refine(&mut self) {
        if !runs(Stage::Refinement) {
            return;
        }
        let pair = self.pair;
        let refined = RefinedPair::new(pair);
        // Once each: from the same start it would end the same.
        while let Some(start) = self.tried.iter_mut().find_map(Option::take) {
            let left = self.options.after(self.iterations).max_iterations();
            // Those that find out on which side of contact a narrow bracket is take half of that.
            let left = if self.narrow() && self.goals.0.is_narrow() { left.min(PATIENCE) } else { left };
            let steps = refined.distance(&start, left, |found| {
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
}

/// Where the only active constraint of a body is 1, one Newton step along its gradient from a point
/// near that; the point itself where there are several.
fn on_surface(body: &Posed<'_>, active: &Active, v: Vector3<f64>) -> Vector3<f64> {
    let Some(i) = active.single() else { return v };
    let sample = body.sample(i.into(), &v);
    let gradient = sample.gradient();
    v + gradient * ((1.0 - sample.value()) / gradient.norm_squared())
}
