//! Level distance `d(A‖B) = min p_A(x)` over x in B, p the largest constraint.

use super::Status;
use super::bracket::{Multipliers, level_lower};
use super::distance::{self, split};
use super::level_smooth::{FollowLevel, LevelProven, LevelTrace, Saturated};
use super::newton::{Active, LevelNewton};
use super::options::Options;
use super::pair::Pair;
use super::pose::Pose;
use super::programs::Level;
use super::sharp::SharpPair;
use super::twist::Twist;
use super::union;
use super::warm::{Hint, WarmStart};
use crate::body::{Body, MAX_CONSTRAINTS, Solid};
use crate::optimize::minimise;
use crate::polynomial::dispatch;
use nalgebra::{SVector, Vector3};
use std::ops::ControlFlow;

/// Level distance with its proof; unit-free but for the witness.
#[derive(Clone, Copy, Debug)]
pub struct LevelDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound.
    pub lower: f64,
    /// Proven upper bound, attained at the witness.
    pub upper: f64,
    /// A point of the second body where the first one's polynomial is at most `upper`; world frame, metres.
    pub witness: Vector3<f64>,
    /// How fast d falls as the level of the second body rises from 1: the sum of the multipliers of its constraints.
    pub multiplier: f64,
    /// Whether the second body holds the minimiser of the first one's polynomial: d is its minimum, the multiplier and all
    /// derivatives are 0, and d says no more about depth.
    pub saturated: bool,
    /// Derivative of d with respect to the pose of the first body, 1/m and 1/rad: a twist (v, ω) changes d by `-g·v - ((x - t) × g)·ω`,
    /// g the gradient of the first body's polynomial at the witness x (of several active constraints, weighted by their
    /// multipliers) and t the translation.
    pub gradient_a: Twist,
    /// Derivative of d with respect to the pose of the second body: the same force the other way, about its own translation.
    pub gradient_b: Twist,
    /// Whether another pair of parts may be as low, their brackets meeting: witness, multiplier and gradients may then jump.
    /// Never for single bodies.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl LevelDistance {
    /// The answer inside the bracket: the upper bound, which the witness attains.
    pub fn value(&self) -> f64 {
        self.upper
    }
}

/// Level distance of `a` over `b`: the smallest value that the stored polynomial of `a` (the largest of its constraints)
/// takes on `b`. Above 1 the bodies are apart, at 1 they touch, below 1 they overlap; it is not symmetric.
///
/// The bracket is as narrow as `options` ask, relative to `max(1, |d|)`, or the status says that it is not. When the minimiser of `a`'s
/// polynomial lies in `b`, the answer is its minimum ([`Body::min_value`]) and says no more about depth. Derivatives are by the
/// envelope theorem: at the minimiser x the gradients of both bodies balance, `g_a + μ g_b = 0`. `warm` is read and
/// then replaced by the hint for the next query of this pair in this order.
///
/// Of solids with several parts it is the least over the pairs of parts, the polynomial of a union being the least of those
/// of its parts: one part of `a` and the part of `b` where it is lowest, to which witness, multiplier and `saturated` belong.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel::body::{Body, Compound};
/// use sublevel::measure::{Options, Pose, WarmStart, level_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?;
/// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let d = level_distance(&ball, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((d.value() - 4.0).abs() < 1e-8); // |x|² is 4 at (2, 0, 0)
/// assert!((d.gradient_b.linear - Vector3::new(4.0, 0.0, 0.0)).norm() < 1e-6); // and its slope there 4
///
/// let pair = Compound::new("pair", vec![ball.clone(), Body::ball("far", Vector3::new(0.0, 5.0, 0.0), 1.0)?])?;
/// let e = level_distance(&pair, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((e.value() - d.value()).abs() < 1e-8 && !e.tied);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn level_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    union::level_distance(a, pose_a, b, pose_b, options, warm)
}

/// Level distance of one body over another.
pub(super) fn between(
    a: &Body,
    pose_a: &Pose,
    b: &Body,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> LevelDistance {
    let mut spent = 0;
    match &mut warm.hint {
        Hint::LevelSmooth(trace) => match dispatch(FollowLevel { a, pose_a, b, pose_b, options, trace }) {
            Ok(proven) => return proven.answer(a, pose_a, pose_b),
            Err(rounds) => spent = rounds,
        },
        Hint::Saturated => {
            if let Some(answer) = saturated(a, pose_a, b, pose_b, options) {
                return answer;
            }
        }
        _ => {}
    }
    let pair = Pair::new(a, pose_a, b, pose_b);
    let mut search = Search::new(&pair, options);
    search.iterations = spent;
    search.run(&warm.hint);
    *warm = search.hint().into();
    search.answer(pose_a, pose_b)
}

/// The answer where the interior point of `a` is proven to lie in `b` and what is known of the minimum is enough.
fn saturated(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose, options: &Options<'_>) -> Option<LevelDistance> {
    let (lower, upper) = (a.trust().least, a.min_value());
    let narrow = upper - lower <= options.accuracy() * upper.abs().max(1.0);
    (narrow && dispatch(Saturated { a, pose_a, b, pose_b })).then(|| LevelDistance {
        status: Status::Converged,
        lower,
        upper,
        witness: pose_a.transform_point(a.interior_point()),
        multiplier: 0.0,
        saturated: true,
        gradient_a: Twist::ZERO,
        gradient_b: Twist::ZERO,
        tied: false,
        iterations: 0,
    })
}

/// Most changes of scale; each is by a thousand, and values reach about 1e12 at degree 8.
const MAX_ROUNDS: u32 = 6;

/// Starts of values above this, relative to the least known, are too steep.
const STEEP: f64 = 1e3;

/// How much narrower a bracket has to be that multipliers are taken from which Newton's method did not find.
const REFINED: f64 = 1e-3;

/// A solve in progress: the best bracket so far and where it was attained, in query units.
struct Search<'a> {
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
    /// Whether its multipliers are those of Newton's method: a bracket holds others to its root only.
    refined: bool,
    /// Where Newton's method ended last.
    ended: Option<LevelNewton>,
    iterations: u32,
}

impl<'a> Search<'a> {
    fn new(pair: &'a Pair<'a>, options: &'a Options<'a>) -> Self {
        Self {
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
            iterations: 0,
        }
    }

    fn done(&self) -> bool {
        self.within(self.accuracy)
    }

    fn within(&self, accuracy: f64) -> bool {
        self.upper.is_finite() && self.upper - self.lower <= accuracy * self.upper.abs().max(1.0)
    }

    fn run(&mut self, hint: &Hint) {
        if let Hint::Level { x_b, active_a, active_b } = hint {
            let active =
                (Active::from_bits(*active_a, self.pair.a.len()), Active::from_bits(*active_b, self.pair.b.len()));
            if let (Some(a), Some(b)) = active {
                self.newton(self.pair.b_to_query(x_b), a, b);
            }
        }
        if !self.done() && !self.exhausted() {
            self.interior_point();
        }
        if !self.done() && !self.exhausted() {
            self.sharpen(self.accuracy);
        }
        if !self.done() && !self.exhausted() {
            self.start_nearest();
        }
        if !self.done() && !self.exhausted() {
            self.sharpen(self.accuracy);
        }
        if !self.refined && !self.saturated() && !self.exhausted() {
            // Constraints whose slacks are as small as the bracket is wide may carry multipliers that are not theirs.
            self.accuracy = REFINED * self.options.accuracy();
            self.sharpen(self.accuracy);
            if !self.done() && !self.exhausted() {
                self.descend(REFINED);
            }
            self.accuracy = self.options.accuracy();
        }
    }

    /// Starts again from the point of B nearest to A, or a common one: where A is tiny or thin, its values rise so steeply that
    /// nothing else shows the way, and near and low are about the same.
    fn start_nearest(&mut self) {
        let (x, active) = distance::nearest(self.pair, self.options, &mut self.iterations);
        self.attain(&x);
        if let Some((a, b)) = active {
            self.newton(x, a, b);
        }
        if !self.done() && !self.exhausted() {
            let (pair, bound) = (self.pair, STEEP * self.upper.abs().max(1.0));
            let mut inset = 0.1;
            while inset > 1e-12 && !(value(pair, &inner(pair, &self.x, inset)) < bound) {
                inset *= 0.1;
            }
            self.descend(inset);
        }
    }

    /// Goes on in twice the precision where rounding keeps the bracket wide.
    fn sharpen(&mut self, accuracy: f64) {
        let pair = self.pair;
        let sharp = SharpPair::new(pair);
        let (of_a, of_b) = &self.multipliers;
        let (a, b) =
            (Active::from_forces(&pair.a, &self.proven, of_a), Active::from_forces(&pair.b, &self.proven, of_b));
        let proven = LevelNewton { x: self.proven, a, b };
        for start in [Some(proven), self.ended].into_iter().flatten().filter(|start| start.a.len > 0) {
            let left = self.options.max_iterations() - self.iterations.min(self.options.max_iterations());
            let steps = sharp.level(&start, left, |found| {
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

    /// Interior-point method from a point of B on the side of A, with Newton's method tried as soon as it shows the active
    /// constraints. Values of A fall by orders of magnitude on the way in: each round scales them anew.
    fn interior_point(&mut self) {
        let pair = self.pair;
        self.attain(&pair.b.interior);
        self.attain(&pair.a.interior);
        if pair.b.contains(&pair.a.interior) {
            // Saturated: B does not hold the minimiser back.
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
        let pair = self.pair;
        for _ in 0..MAX_ROUNDS {
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

    /// Brackets the answer from an iterate of the interior-point method and tries Newton's method from it.
    fn examine(&mut self, x: &Vector3<f64>, rows: &[f64], scale: f64) {
        let (of_a, mut of_b) = split(self.pair, rows, 1.0);
        of_b.iter_mut().for_each(|multiplier| *multiplier *= scale);
        self.attain(x);
        self.bound(x, &of_a, &of_b);
        if !self.done() {
            self.newton(*x, Active::from_multipliers(&of_a), Active::from_multipliers(&of_b));
        }
        // A vanishing multiplier means that B does not hold the minimiser back.
        if !self.done() && self.pair.b.contains(x) {
            self.newton(*x, Active::from_multipliers(&of_a), Active::default());
        }
    }

    fn newton(&mut self, x: Vector3<f64>, a: Active, b: Active) {
        if !x.iter().all(|value| value.is_finite()) {
            return;
        }
        let mut newton = LevelNewton { x, a, b };
        let (options, before) = (self.options, self.iterations);
        let steps = newton.run(
            self.pair,
            |steps| options.exhausted(before + steps),
            |at| {
                self.refined |= self.bound(&at.x, &at.a.multipliers(), &at.b.multipliers());
                if self.attain(&at.x) {
                    self.active = (at.a, at.b);
                }
                self.done()
            },
        );
        self.iterations += steps;
        self.ended = Some(newton);
    }

    /// Takes the lower bound of a trial point and multipliers if it is the best so far.
    fn bound(&mut self, x: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) -> bool {
        let lower = level_lower(self.pair, x, of_a, of_b);
        let better = lower > self.lower;
        if better {
            (self.lower, self.multipliers) = (lower, normalized(of_a, of_b));
            (self.proven, self.refined) = (*x, false);
        }
        better
    }

    /// Pulls a trial point into B and takes it if A's polynomial is the smallest there so far.
    fn attain(&mut self, x: &Vector3<f64>) -> bool {
        let Some(x) = self.pair.b.pull_in(x) else { return false };
        let upper = self.pair.a.value_upper(&x, self.pair.b.displacement(&x));
        let better = upper < self.upper;
        if better {
            (self.upper, self.x) = (upper, x);
        }
        better
    }

    fn hint(&self) -> Hint {
        let (x, y) = (self.pair.to_a(&self.x), self.pair.to_b(&self.x));
        let (a, b) = (self.pair.a.body, self.pair.b.body);
        match (self.active.0.single(), self.active.1.single()) {
            _ if self.saturated() => Hint::Saturated,
            (Some(of_a), Some(of_b)) => Hint::LevelSmooth(LevelTrace::new(a, &x, b, &y, [of_a, of_b])),
            _ => Hint::Level { x_b: y, active_a: self.active.0.bits(), active_b: self.active.1.bits() },
        }
    }

    /// Whether B does not hold the minimiser of A's polynomial back: it holds the minimiser, or the bracket needed no
    /// multiplier of B.
    fn saturated(&self) -> bool {
        let free = self.multipliers.1.iter().all(|multiplier| *multiplier == 0.0);
        self.done() && (free || self.pair.b.contains(&self.pair.a.interior))
    }

    fn answer(&self, pose_a: &Pose, pose_b: &Pose) -> LevelDistance {
        let (pair, saturated) = (self.pair, self.saturated());
        let (of_a, of_b) = &self.multipliers;
        let gradient = of_a.iter().enumerate().take(pair.a.len()).filter(|(_, weight)| **weight > 0.0);
        let gradient: Vector3<f64> = gradient.map(|(i, weight)| pair.a.jet(i, &self.x).gradient * *weight).sum();
        let force = pair.direction_to_world(&gradient) / pair.unit() * if saturated { 0.0 } else { 1.0 };
        let witness = pair.to_world(&self.x);
        LevelDistance {
            status: if self.done() { Status::Converged } else { Status::BracketWide },
            lower: self.lower,
            upper: self.upper,
            witness,
            multiplier: if saturated { 0.0 } else { of_b.iter().sum() },
            saturated,
            gradient_a: Twist::of_force(-force, &witness, pose_a.translation()),
            gradient_b: Twist::of_force(force, &witness, pose_b.translation()),
            tied: false,
            iterations: self.iterations,
        }
    }
}

/// The largest constraint of A.
fn value(pair: &Pair<'_>, x: &Vector3<f64>) -> f64 {
    (0..pair.a.len()).map(|i| pair.a.jet(i, x).value).fold(f64::MIN, f64::max)
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

impl LevelProven {
    fn answer(&self, a: &Body, pose_a: &Pose, pose_b: &Pose) -> LevelDistance {
        let witness = pose_a.transform_point(&(a.normalization().center + Vector3::from(self.x)));
        let force = pose_a.transform_direction(&Vector3::from(self.gradient));
        LevelDistance {
            status: Status::Converged,
            lower: self.lower,
            upper: self.upper,
            witness,
            multiplier: self.multiplier,
            saturated: false,
            gradient_a: Twist::of_force(-force, &witness, pose_a.translation()),
            gradient_b: Twist::of_force(force, &witness, pose_b.translation()),
            tied: false,
            iterations: self.rounds,
        }
    }
}

#[cfg(test)]
mod tests;
