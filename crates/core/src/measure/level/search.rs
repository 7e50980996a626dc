//! The search for a level distance where continuation alone has not proven it: every method in
//! turn, from the cheapest, each of them improving one bracket.

use super::answer::LevelDistance;
use crate::body::MAX_CONSTRAINTS;
use crate::measure::bounds::duality_bounds::{Multipliers, level_lower};
use crate::measure::distance;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::solver::barrier_programs::{Level, split};
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::level_continuation::{LevelTrace, Settled};
use crate::measure::solver::level_newton::LevelNewton;
use crate::measure::solver::refinement::RefinedPair;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::status::Status;
use crate::measure::warm::Hint;
use crate::optimize::{Approach, minimise};
use nalgebra::{SVector, Vector3};
use std::ops::ControlFlow;

/// How much narrower a bracket has to be, dimensionless, that multipliers are taken from which
/// Newton's method did not find: they are known to the root of its width.
///
/// A larger value returns multipliers and gradients that are off by more; a smaller one asks for
/// brackets below rounding. Exercised by `gradients_are_the_derivatives_of_the_value`.
const REFINED: f64 = 1e-3;

/// A solve in progress: the best bracket so far and where it was attained, in query units.
pub(super) struct Search<'a> {
    pair: &'a Pair<'a>,
    options: &'a Options<'a>,
    /// Of the bracket that is being worked for.
    accuracy: f64,
    lower: f64,
    upper: f64,
    x: Vector3<f64>,
    active: (Active, Active),
    /// Those of the best lower bound, those of A of sum 1.
    multipliers: (Multipliers, Multipliers),
    /// Where that bound was found.
    proven: Vector3<f64>,
    /// Whether its multipliers are those of Newton's method, balanced or in double-double: a
    /// bracket determines others to its root only.
    refined: bool,
    /// Where Newton's method ended last.
    ended: Option<LevelNewton>,
    /// Whether it had no step left to take there.
    settled: bool,
    iterations: u32,
}

impl<'a> Search<'a> {
    /// A search that has only a point of B yet, after that many iterations.
    pub(super) fn new(pair: &'a Pair<'a>, options: &'a Options<'a>, iterations: u32) -> Self {
        let mut search = Self {
            pair,
            options,
            accuracy: options.accuracy(),
            lower: pair.a.body.trust().least,
            upper: f64::INFINITY,
            x: pair.b.interior,
            active: (Active::default(), Active::default()),
            multipliers: ([0.0; MAX_CONSTRAINTS], [0.0; MAX_CONSTRAINTS]),
            proven: pair.b.interior,
            refined: false,
            ended: None,
            settled: false,
            iterations,
        };
        search.attain(&pair.b.interior);
        search
    }

    fn done(&self) -> bool {
        self.within(self.accuracy)
    }

    fn within(&self, accuracy: f64) -> bool {
        self.upper.is_finite() && self.upper - self.lower <= accuracy * self.upper.abs().max(1.0)
    }

    /// Goes on in double-double arithmetic from where continuation has ended.
    pub(super) fn resume(&mut self, settled: &Settled) {
        let [mut a, mut b] = settled.active.map(|i| {
            let mut active = Active::default();
            active.push(usize::from(i));
            active
        });
        (a.multiplier[0], b.multiplier[0]) = (1.0, settled.multiplier);
        self.ended = Some(LevelNewton { x: self.pair.b_to_query(&settled.point), a, b });
        self.refine(self.accuracy);
    }

    /// From a hint, or from what the outlines show.
    pub(super) fn run(&mut self, hint: &Hint, start: Option<&Approach>) {
        if self.done() && self.refined {
            return;
        }
        if let Hint::Level { x_b, active_a, active_b } = hint {
            let active =
                (Active::from_bits(*active_a, self.pair.a.len()), Active::from_bits(*active_b, self.pair.b.len()));
            if let (Some(a), Some(b)) = active {
                self.newton(self.pair.b_to_query(x_b), a, b);
            }
        }
        if let Some(start) = start
            && start.common.is_none()
            && !self.done()
            && !self.exhausted()
        {
            self.outlined(start);
        }
        if self.settled && !self.done() && !self.exhausted() {
            self.refine(self.accuracy);
        }
        if !self.done() && !self.exhausted() {
            self.interior_point();
        }
        if !self.done() && !self.exhausted() {
            self.refine(self.accuracy);
        }
        if !self.done() && !self.exhausted() {
            self.start_nearest();
        }
        if !self.done() && !self.exhausted() {
            self.refine(self.accuracy);
        }
        if !self.refined && !self.saturated() && !self.exhausted() {
            // Constraints whose slacks are as small as the bracket is wide may carry multipliers
            // that are not theirs.
            self.accuracy = REFINED * self.options.accuracy();
            self.refine(self.accuracy);
            if !self.done() && !self.exhausted() {
                self.descend(REFINED);
            }
            self.accuracy = self.options.accuracy();
        }
    }

    /// Newton's method from where the outline of B is nearest to A's interior point, with the
    /// constraints that are active there.
    fn outlined(&mut self, start: &Approach) {
        if !runs(Stage::SupportTables) {
            return;
        }
        let pair = self.pair;
        let outward = pair.a.pulled_back(&start.n);
        for x in [start.x, start.corners.1] {
            let (a, b) = (Active::near(&pair.a, &x, &outward), Active::near(&pair.b, &x, &-outward));
            self.attain(&x);
            self.newton(x, a, b);
            if self.done() || self.settled || self.exhausted() {
                return;
            }
        }
    }

    /// Starts again from the point of B nearest to A, or a common one: where A is tiny or thin, its
    /// values rise so steeply that nothing else shows the way, and near and low are about the same.
    fn start_nearest(&mut self) {
        let (x, active) = distance::nearest(self.pair, self.options, &mut self.iterations);
        self.attain(&x);
        if let Some((a, b)) = active {
            self.newton(x, a, b);
        }
        if !self.done() && !self.exhausted() {
            // Values grow with the power of the degree: starts much above the least known are moved
            // inward.
            let (pair, bound) = (self.pair, 1e3 * self.upper.abs().max(1.0));
            let mut inset = 0.1;
            while inset > 1e-12 && !(value(pair, &inner(pair, &self.x, inset)) < bound) {
                inset *= 0.1;
            }
            self.descend(inset);
        }
    }

    /// Goes on in double-double arithmetic where rounding keeps the bracket wide.
    fn refine(&mut self, accuracy: f64) {
        if !runs(Stage::Refinement) {
            return;
        }
        let pair = self.pair;
        let refined = RefinedPair::new(pair);
        let (of_a, of_b) = &self.multipliers;
        let (a, b) = (
            Active::from_weighted_multipliers(&pair.a, &self.proven, of_a),
            Active::from_weighted_multipliers(&pair.b, &self.proven, of_b),
        );
        let proven = LevelNewton { x: self.proven, a, b };
        for start in [Some(proven), self.ended].into_iter().flatten().filter(|start| start.a.len > 0) {
            let left = self.options.after(self.iterations).max_iterations();
            let steps = refined.level(&start, left, |found| {
                if found.lower > self.lower {
                    let (a, b) = &found.active;
                    (self.lower, self.multipliers) = (found.lower, normalized(&a.multipliers(), &b.multipliers()));
                    self.refined = true;
                }
                if found.upper < self.upper {
                    (self.upper, self.x, self.active) = (found.upper, found.x, found.active);
                }
                self.within(accuracy) || self.options.stopped()
            });
            self.iterations += steps;
            if self.within(accuracy) || self.exhausted() {
                return;
            }
        }
    }

    fn exhausted(&self) -> bool {
        self.options.exhausted(self.iterations)
    }

    /// Interior-point method from a point of B on the side of A, with Newton's method tried as soon
    /// as it shows the active constraints. Values of A decrease by orders of magnitude on the way
    /// in: each round scales them again.
    fn interior_point(&mut self) {
        if !runs(Stage::InteriorLevel) {
            return;
        }
        let pair = self.pair;
        self.attain(&pair.a.interior);
        if pair.b.contains(&pair.a.interior) {
            // Saturated: B's constraints are inactive.
            let mut first = [0.0; MAX_CONSTRAINTS];
            first[0] = 1.0;
            self.newton(pair.a.interior, Active::from_multipliers(&first), Active::default());
            if self.done() || self.exhausted() {
                return;
            }
        }
        self.descend(0.1);
    }

    /// Rounds of the interior-point method from points that far inside B.
    fn descend(&mut self, mut inset: f64) {
        if !runs(Stage::InteriorLevel) {
            return;
        }
        let pair = self.pair;
        // Each changes the scale by a thousand, and values reach about 1e12 at degree 8.
        for _ in 0..6 {
            // Strictly inside, by less each round: the scale must not rise again.
            let start = inner(pair, &self.x, inset);
            inset *= 0.1;
            let first = value(pair, &start);
            let scale = first.abs().max(1.0);
            let mut v = SVector::from([start.x, start.y, start.z, first / scale + 0.5]);
            let mut attempt = 1e-1;
            let mut rescale = false;
            let program = Level { pair, both: false, scale };
            minimise(&program, &mut v, 1.0, |iterate| {
                self.iterations += 1;
                let x = iterate.v.xyz();
                if scale > 1.0 && value(pair, &x) < 1e-3 * scale && self.attain(&x) && self.upper < 1e-2 * scale {
                    rescale = true;
                    return ControlFlow::Break(());
                }
                let value = iterate.v[3].abs().max(1.0 / scale);
                if iterate.gap < attempt * value {
                    attempt = (iterate.gap / value) * 1e-2;
                    self.examine(&x, iterate.multipliers, scale);
                }
                if self.done() || self.exhausted() || attempt < 1e-18 {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            if !rescale || self.exhausted() {
                break;
            }
        }
    }

    /// Brackets the answer from an iterate of the interior-point method and tries Newton's method
    /// from it.
    fn examine(&mut self, x: &Vector3<f64>, rows: &[f64], scale: f64) {
        let (of_a, mut of_b) = split(self.pair, rows, 1.0);
        of_b.iter_mut().for_each(|multiplier| *multiplier *= scale);
        self.attain(x);
        self.bound(x, &of_a, &of_b);
        if !self.done() {
            self.newton(*x, Active::from_multipliers(&of_a), Active::from_multipliers(&of_b));
        }
        // A vanishing multiplier means that B's constraints are inactive.
        if !self.done() && self.pair.b.contains(x) {
            self.newton(*x, Active::from_multipliers(&of_a), Active::default());
        }
    }

    fn newton(&mut self, x: Vector3<f64>, a: Active, b: Active) {
        if !runs(Stage::Newton) {
            return;
        }
        if !x.iter().all(|value| value.is_finite()) {
            return;
        }
        let mut newton = LevelNewton { x, a, b };
        let (options, before) = (self.options, self.iterations);
        let ended = newton.run(
            self.pair,
            |steps| options.exhausted(before + steps),
            |at| {
                self.bound(&at.x, &at.a.multipliers(), &at.b.multipliers());
                if self.attain(&at.x) {
                    self.active = (at.a, at.b);
                }
                self.done() && self.adopt(at)
            },
        );
        self.iterations += ended.steps;
        (self.ended, self.settled) = (Some(newton), ended.settled);
    }

    /// Takes all of an iterate at which forces are balanced, if the bracket it proves is narrow;
    /// whether it is.
    fn adopt(&mut self, at: &LevelNewton) -> bool {
        let pair = self.pair;
        let Some(x) = pair.b.move_inside(&at.x).filter(|_| at.is_balanced(pair)) else { return false };
        let (of_a, of_b) = (at.a.multipliers(), at.b.multipliers());
        let (lower, upper) = (level_lower(pair, &at.x, &of_a, &of_b), pair.a.value_upper(&x, pair.b.displacement(&x)));
        let narrow = upper - lower <= self.accuracy * upper.abs().max(1.0);
        if narrow {
            (self.lower, self.upper, self.x, self.active) = (lower, upper, x, (at.a, at.b));
            (self.multipliers, self.proven, self.refined) = (normalized(&of_a, &of_b), at.x, true);
        }
        narrow
    }

    /// Takes the lower bound of a trial point and multipliers if it is the best so far.
    fn bound(&mut self, x: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) {
        let lower = level_lower(self.pair, x, of_a, of_b);
        if lower > self.lower {
            (self.lower, self.multipliers) = (lower, normalized(of_a, of_b));
            (self.proven, self.refined) = (*x, false);
        }
    }

    /// Pulls a trial point into B and takes it if A's polynomial is the smallest there so far.
    fn attain(&mut self, x: &Vector3<f64>) -> bool {
        let Some(x) = self.pair.b.move_inside(x) else { return false };
        let upper = self.pair.a.value_upper(&x, self.pair.b.displacement(&x));
        let better = upper < self.upper;
        if better {
            (self.upper, self.x) = (upper, x);
        }
        better
    }

    pub(super) fn hint(&self) -> Hint {
        let (x, y) = (self.pair.to_a(&self.x), self.pair.to_b(&self.x));
        let (pose_a, pose_b) = self.pair.poses();
        let (a, b) = ((self.pair.a.body, pose_a, &x), (self.pair.b.body, pose_b, &y));
        match (self.active.0.single(), self.active.1.single()) {
            _ if self.saturated() => Hint::Saturated,
            (Some(of_a), Some(of_b)) => Hint::LevelSmooth(LevelTrace::new(a, b, [of_a, of_b])),
            _ => Hint::Level { x_b: y, active_a: self.active.0.bits(), active_b: self.active.1.bits() },
        }
    }

    /// Whether B's constraints are inactive at the minimiser of A's polynomial: B contains the
    /// minimiser, or the bracket needed no multiplier of B.
    fn saturated(&self) -> bool {
        let free = self.multipliers.1.iter().all(|multiplier| *multiplier == 0.0);
        self.done() && (free || self.pair.b.contains(&self.pair.a.interior))
    }

    pub(super) fn answer(&self, pose_a: &Pose, pose_b: &Pose) -> LevelDistance {
        let (pair, saturated) = (self.pair, self.saturated());
        let (of_a, of_b) = &self.multipliers;
        let gradient = pair.a.weighted_gradient(&self.x, &of_a.map(|weight| weight.max(0.0)));
        let gradient = pair.direction_to_world(&gradient) / pair.unit() * if saturated { 0.0 } else { 1.0 };
        let witness = pair.to_world(&self.x);
        LevelDistance {
            status: Status::of(self.done()),
            lower: self.lower,
            upper: self.upper,
            witness,
            multiplier: if saturated { 0.0 } else { of_b.iter().sum() },
            saturated,
            gradient_a: Twist::of_gradient(-gradient, &witness, pose_a.translation()),
            gradient_b: Twist::of_gradient(gradient, &witness, pose_b.translation()),
            tied: false,
            iterations: self.iterations,
        }
    }
}

/// The largest constraint of A.
fn value(pair: &Pair<'_>, x: &Vector3<f64>) -> f64 {
    (0..pair.a.len()).map(|i| pair.a.value(i, x)).fold(f64::MIN, f64::max)
}

/// The point that part of the way from x to the interior point of B.
fn inner(pair: &Pair<'_>, x: &Vector3<f64>, inset: f64) -> Vector3<f64> {
    x + (pair.b.interior - x) * inset
}

/// Multipliers scaled so that those of A have the sum 1.
fn normalized(of_a: &Multipliers, of_b: &Multipliers) -> (Multipliers, Multipliers) {
    let total: f64 = of_a.iter().sum();
    (of_a.map(|multiplier| multiplier / total), of_b.map(|multiplier| multiplier / total))
}
