//! The shortest known translation that takes overlapping bodies apart.

use crate::body::Solid;
use crate::measure::bounds::duality_bounds::{DUALITY_ROUNDING, DualTrial, descent};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::continuation::{Follow, Proven, Seek, Trace};
use crate::measure::solver::kkt_newton::{AT, Active, DistanceNewton};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::support_point::{SupportPoint, support_of_a, support_of_b};
use crate::measure::solver::tangent_newton::SEEK_ROUNDS;
use crate::measure::solver::two_point_problem::Through;
use crate::measure::warm::Hint;
use crate::polynomial::dispatch;
use nalgebra::{Vector2, Vector3};

/// The middle of support points with the constraints that are active at all of them, and there,
/// too: both sides of a slab are one constraint, but the middle between them is on neither.
fn common(body: &Posed<'_>, points: [SupportPoint; 4]) -> SupportPoint {
    let x = points.iter().map(|point| point.x).sum::<Vector3<f64>>() * 0.25;
    let all = points.iter().fold(ActiveSet::MAX, |all, point| all & point.active);
    let at = |i: &usize| all >> i & 1 == 1 && body.value(*i, &x) > 1.0 - AT;
    SupportPoint { x, active: (0..body.len()).filter(at).fold(0, |bits, i| bits | 1 << i) }
}

/// Weights by which points of a difference of bodies, all at least that high along n, have a point
/// on the axis along n between them, or one no farther from it than `near`: then no direction close
/// to n shows a smaller depth, but for their support deficit.
fn surrounding(
    n: &Vector3<f64>,
    across: &Vector3<f64>,
    w: &[Vector3<f64>; 4],
    height: f64,
    near: f64,
) -> Option<[f64; 4]> {
    let other = n.cross(across);
    let p = w.map(|w| Vector2::new(w.dot(across), w.dot(&other)));
    let passes = |(i, j): (usize, usize)| {
        let along: Vector2<f64> = p[j] - p[i];
        let share = (-p[i].dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let mut weights = [0.0; 4];
        (weights[i], weights[j]) = (1.0 - share, share);
        ((p[i] + along * share).norm() <= near).then_some(weights)
    };
    // Strictly: points all in line with the axis have nothing but their segments.
    let holds = |[i, j, k]: [usize; 3]| {
        let turns = [p[j].perp(&p[k]), p[k].perp(&p[i]), p[i].perp(&p[j])];
        let sum: f64 = turns.iter().sum();
        let mut weights = [0.0; 4];
        [weights[i], weights[j], weights[k]] = turns.map(|turn| turn / sum);
        let same = turns.iter().all(|turn| *turn > 0.0) || turns.iter().all(|turn| *turn < 0.0);
        same.then_some(weights)
    };
    if !w.iter().all(|w| w.dot(n) >= height) {
        return None;
    }
    let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    let triangles = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
    pairs.into_iter().find_map(passes).or_else(|| triangles.into_iter().find_map(holds))
}

/// First step of the search around a direction, as the tangent of its angle; dimensionless.
/// Newton's method ends within about its square of an optimum on one side. Its square is the last
/// step: depths are then stationary to the square of that, which is rounding.
///
/// A larger value takes more rounds and ends farther from the best direction, a smaller one does
/// not cross the edges that stopped Newton's method. Exercised by
/// `searches_end_at_the_best_direction_alone`.
const FIRST_STEP: f64 = 1e-4;

/// By how much more depth a direction may show that is taken as the better one of two because it is
/// aligned, relative to the accuracy asked for; dimensionless.
///
/// A larger value returns a depth that is less tight, a smaller one prefers directions whose
/// normals are not those of the surfaces. Exercised by `one_normal_and_one_slope_through_contact`.
const ROUGHLY: f64 = 0.01;

/// Width of a bracket asked for, in query units; finite even where no depth is known, so that an
/// infinite bracket is never narrow.
pub(in crate::measure) fn tolerance(pair: &Pair<'_>, options: &Options<'_>, depth: f64) -> f64 {
    (options.depth_accuracy() * depth.min(f64::MAX)).max(pair.tolerance(options.accuracy()))
}

/// The same of two solids, metres.
pub(in crate::measure) fn solid_tolerance(a: &impl Solid, b: &impl Solid, options: &Options<'_>, depth: f64) -> f64 {
    let radius = a.circumscribed().radius.min(b.circumscribed().radius);
    (options.depth_accuracy() * depth.min(f64::MAX)).max(options.accuracy() * radius)
}

/// Rigorous upper bound of f(n), the depth along n, from multipliers for -n of A and for n of B as
/// long as it is; with its sign turned, a lower bound of the signed distance.
fn depth_along(pair: &Pair<'_>, trial: &DualTrial<'_>) -> f64 {
    let DualTrial { x, y, n, of_a, of_b } = *trial;
    let length = n.norm();
    let n = n / length;
    let falls =
        descent(&pair.a, x, &n, &of_a.map(|m| m / length)) + descent(&pair.b, y, &-n, &of_b.map(|m| m / length));
    let displaced = (pair.a.displacement(x) + pair.b.displacement(y)) * (1.0 + 1e-14);
    let bound = n.dot(&(y - x)) + falls + displaced + DUALITY_ROUNDING * (x.norm() + y.norm() + falls.abs());
    // A NaN bounds nothing.
    if bound.is_nan() { f64::INFINITY } else { bound }
}

/// A direction with points near the surfaces that may be farthest against it and along it, and what
/// is active there with its multipliers; query frame.
#[derive(Clone, Copy)]
struct Candidate {
    x: Vector3<f64>,
    y: Vector3<f64>,
    n: Vector3<f64>,
    a: Active,
    b: Active,
}

/// The shortest separating translation known, in query units.
pub(in crate::measure) struct Best<'a> {
    pub(in crate::measure) pair: &'a Pair<'a>,
    pose_a: &'a Pose,
    pose_b: &'a Pose,
    pub(in crate::measure) options: &'a Options<'a>,
    /// Rigorous upper bound of f along n; negative if n parts the bodies.
    pub(in crate::measure) depth: f64,
    pub(in crate::measure) n: Option<Vector3<f64>>,
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) y: Vector3<f64>,
    /// Distance of points of the bodies at x and y, rounded up, where that was proven with the
    /// depth.
    pub(in crate::measure) attained: Option<f64>,
    active: (Active, Active),
    trace: Option<Trace>,
    /// Whether no direction nearby is better: the points attain what the normal proves.
    pub(in crate::measure) settled: bool,
    pub(in crate::measure) iterations: u32,
}

impl<'a> Best<'a> {
    pub(in crate::measure) fn new(
        pair: &'a Pair<'a>,
        pose_a: &'a Pose,
        pose_b: &'a Pose,
        options: &'a Options<'a>,
    ) -> Self {
        Self {
            pair,
            pose_a,
            pose_b,
            options,
            depth: f64::INFINITY,
            n: None,
            x: pair.a.interior,
            y: pair.b.interior,
            attained: None,
            active: Default::default(),
            trace: None,
            settled: false,
            iterations: 0,
        }
    }

    /// Starts from the answer to an earlier query.
    pub(in crate::measure) fn follow(&mut self, hint: &Hint) {
        match hint {
            Hint::Smooth(trace) if runs(Stage::Follow) => {
                let mut trace = *trace;
                let (a, b, relation) = (self.pair.a.body, self.pair.b.body, self.through(None));
                match dispatch(Follow { a, b, relation, options: self.options, trace: &mut trace }) {
                    Ok(proven) => self.take(&proven, trace),
                    Err(lost) => self.iterations += lost.rounds,
                }
            }
            Hint::Apart { x_a, y_b, normal_a, active_a, active_b } => {
                let a = SupportPoint { x: self.pair.a_to_query(x_a), active: *active_a };
                let b = SupportPoint { x: self.pair.b_to_query(y_b), active: *active_b };
                self.polish(&a, &b, normal_a);
            }
            _ => {}
        }
    }

    /// Looks for the shortest translation near n, or where the bodies seem to face each other;
    /// whether it found one.
    pub(in crate::measure) fn seek(&mut self, n: Option<&Vector3<f64>>) -> bool {
        let (pair, options, relation) = (self.pair, self.options, self.through(n));
        if !runs(Stage::Seek) || options.exhausted(self.iterations) {
            return false;
        }
        let most = SEEK_ROUNDS.min(options.max_iterations() - self.iterations);
        let (a, b) = (pair.a.body, pair.b.body);
        let mut trace = Trace::default();
        match dispatch(Seek { a, b, relation, from: None, most, options, trace: &mut trace }) {
            Ok(proven) => {
                self.take(&proven, trace);
                true
            }
            Err(lost) => {
                self.iterations += lost.rounds;
                false
            }
        }
    }

    /// The same pair, with nothing known.
    pub(in crate::measure) fn again(&self) -> Self {
        Self { iterations: self.iterations, ..Self::new(self.pair, self.pose_a, self.pose_b, self.options) }
    }

    /// Tries a direction with its support points, and Newton's method from there.
    pub(super) fn offer(&mut self, x: &SupportPoint, y: &SupportPoint, n: &Vector3<f64>) {
        let pair = self.pair;
        let (mut a, mut b) = (
            Active::from_bits(x.active, pair.a.len()).unwrap_or_default(),
            Active::from_bits(y.active, pair.b.len()).unwrap_or_default(),
        );
        if a.fit(&pair.a, &x.x, &-n) && b.fit(&pair.b, &y.x, n) {
            self.try_direction(&Candidate { x: x.x, y: y.x, n: *n, a, b });
        }
        self.polish(x, y, n);
    }

    /// Looks around the best direction for a better one, where edges and corners keep Newton's
    /// method from showing that there is none: what the constraints all around have in common may
    /// be the edge that is best, and otherwise a compass search goes on, its needle turning and its
    /// steps shrinking where they lead to nothing better.
    pub(in crate::measure) fn settle(&mut self) {
        if !runs(Stage::CompassSearch) {
            return;
        }
        let pair = self.pair;
        let enough = 0.1 * pair.tolerance(self.options.accuracy());
        let mut step = FIRST_STEP;
        for round in 0..SEEK_ROUNDS {
            let Some(n) = self.n.filter(|_| step > FIRST_STEP * FIRST_STEP && !self.options.exhausted(self.iterations))
            else {
                return;
            };
            self.iterations += 1;
            let angle = f64::from(round);
            let basis = Vector3::ith(n.iamin(), 1.0);
            let first = n.cross(&basis).normalize();
            let (sin, cos) = angle.sin_cos();
            let needle = first * cos + n.cross(&first) * sin;
            let mut around = [(f64::INFINITY, n, SupportPoint::default(), SupportPoint::default()); 4];
            for (found, tangent) in around.iter_mut().zip([needle, -needle, n.cross(&needle), -n.cross(&needle)]) {
                let turned = (n + tangent * step).normalize();
                let a = support_of_a(pair, &-turned, enough, None);
                let b = support_of_b(pair, &turned, enough, None);
                let (Some(a), Some(b)) = (a, b) else { return };
                *found = (turned.dot(&(b.x - a.x)), turned, a, b);
            }
            let (x, y) = (common(&pair.a, around.map(|found| found.2)), common(&pair.b, around.map(|found| found.3)));
            self.polish(&x, &y, &n);
            let w = around.map(|(_, _, a, b)| b.x - a.x);
            if !self.settled
                && self.n == Some(n)
                && let Some(weights) = surrounding(&n, &needle, &w, self.depth - 10.0 * enough, enough)
            {
                // Of flat faces and edges any point is farthest: these two are along n from each
                // other.
                let mean = |points: [&Vector3<f64>; 4]| points.iter().zip(weights).map(|(x, weight)| *x * weight).sum();
                self.x = mean(around.each_ref().map(|found| &found.2.x));
                self.y = mean(around.each_ref().map(|found| &found.3.x));
                self.settled = true;
            }
            if self.settled {
                return;
            }
            let before = self.depth;
            if let Some((depth, n, a, b)) = around.into_iter().min_by(|p, q| p.0.total_cmp(&q.0))
                && depth < before - enough
            {
                self.offer(&a, &b, &n);
            }
            step *= if self.depth < before - enough { 2.0 } else { 0.2 };
        }
    }

    fn through(&self, n: Option<&Vector3<f64>>) -> Through<'a> {
        let tolerance = self.pair.tolerance(self.options.accuracy()) * self.pair.unit();
        Through { pose_a: self.pose_a, pose_b: self.pose_b, facing: n.map(|n| (*n).into()), tolerance }
    }

    /// Takes a direction proven in metres if its translation is the shortest so far.
    pub(in crate::measure) fn take(&mut self, proven: &Proven, trace: Trace) {
        self.iterations += proven.rounds;
        let (pair, unit) = (self.pair, self.pair.unit());
        if -proven.lower / unit < self.depth {
            let center = pair.a.body.normalization().center;
            (self.depth, self.n) = (-proven.lower / unit, Some(proven.n.into()));
            self.x = pair.a_to_query(&(center + Vector3::from(proven.x)));
            self.y = pair.a_to_query(&(center + Vector3::from(proven.y)));
            (self.attained, self.trace, self.settled) = (Some(proven.upper / unit), Some(trace), true);
        }
    }

    /// Newton's method on the optimality system of the distance, with a negative distance, from
    /// near support points of any number of active constraints.
    fn polish(&mut self, x: &SupportPoint, y: &SupportPoint, n: &Vector3<f64>) {
        let (pair, options) = (self.pair, self.options);
        let (a, b) = (Active::from_bits(x.active, pair.a.len()), Active::from_bits(y.active, pair.b.len()));
        let (Some(a), Some(b)) = (a, b) else { return };
        let finite = x.x.iter().chain(&y.x).chain(n).all(|value| value.is_finite());
        if !runs(Stage::Newton) || !finite || options.exhausted(self.iterations) {
            return;
        }
        let mut newton = DistanceNewton { x: x.x, y: y.x, distance: n.dot(&(x.x - y.x)), n: *n, a, b };
        let tolerance = pair.tolerance(options.accuracy());
        let limit = options.max_iterations() - self.iterations;
        // No direction nearby is better than one of these by more than is asked for.
        let mut known = false;
        self.iterations += newton.run(pair, limit, |at| {
            let depth = self.try_direction(&Candidate { x: at.x, y: at.y, n: at.n, a: at.a, b: at.b });
            // Points of the bodies attain what the normal proves: no better direction is near.
            let n = at.n.normalize();
            let attains = |x: &Vector3<f64>, y: &Vector3<f64>| {
                let attained = n.dot(&(y - x));
                depth - attained <= tolerance && (x - y + n * attained).norm() <= tolerance
            };
            let inside = || pair.a.move_inside(&at.x).zip(pair.b.move_inside(&at.y));
            let settled = attains(&at.x, &at.y) && inside().is_some_and(|(x, y)| attains(&x, &y));
            known |= settled;
            // Beside a short translation there is room for many normals that show about as much.
            let aligned = settled && depth <= self.depth + ROUGHLY * tolerance && at.is_aligned(pair);
            let same = (depth > 0.0) == (self.depth > 0.0) && self.n.is_some_and(|best| best.dot(&n) > ELSEWHERE);
            if aligned && same {
                self.take_direction(depth, &Candidate { x: at.x, y: at.y, n, a: at.a, b: at.b });
            }
            self.settled |= known && depth <= self.depth;
            aligned || options.exhausted(self.iterations)
        });
    }

    /// Takes a direction if its translation is the shortest so far; returns its depth.
    fn try_direction(&mut self, candidate: &Candidate) -> f64 {
        let Candidate { x, y, n, a, b } = candidate;
        let (of_a, of_b) = (a.multipliers(), b.multipliers());
        let depth = depth_along(self.pair, &DualTrial { x, y, n, of_a: &of_a, of_b: &of_b });
        if depth < self.depth
            && let Some(n) = n.try_normalize(0.0)
        {
            self.take_direction(depth, &Candidate { n, ..*candidate });
        }
        depth
    }

    /// Takes a direction, a unit vector, with its proven depth.
    fn take_direction(&mut self, depth: f64, &Candidate { x, y, n, a, b }: &Candidate) {
        (self.depth, self.n, self.x, self.y, self.active) = (depth, Some(n), x, y, (a, b));
        (self.attained, self.trace, self.settled) = (None, None, false);
    }

    pub(in crate::measure) fn hint(&self) -> Option<Hint> {
        let apart = |n: &Vector3<f64>| Hint::apart(self.pair, [&self.x, &self.y, n], &self.active);
        self.n.as_ref().map(|n| self.trace.map_or_else(|| apart(n), Hint::Smooth))
    }

    /// Width of a bracket asked for.
    pub(in crate::measure) fn tolerance(&self) -> f64 {
        tolerance(self.pair, self.options, self.depth)
    }
}

/// Cosine of the angle between two directions below which they count as different ones: 8 degrees.
///
/// Closer to 1, neighbours of the best are reported as ties; smaller, mirror images of slim bodies
/// are missed. Exercised by `ties_are_flagged_and_limits_admitted`.
pub(in crate::measure) const ELSEWHERE: f64 = 0.99;

#[cfg(test)]
mod tests {
    use super::surrounding;
    use nalgebra::Vector3;

    #[test]
    fn points_surround_the_axis_only_if_it_passes_between_them() {
        let (n, x) = (Vector3::z(), Vector3::x());
        let at = |points: [(f64, f64); 4]| {
            let w = points.map(|(x, y)| Vector3::new(x, y, 1.0));
            let Some(weights) = surrounding(&n, &x, &w, 1.0, 1e-9) else { return false };
            let mean: Vector3<f64> = w.iter().zip(weights).map(|(w, weight)| w * weight).sum();
            assert!((mean - n).norm() <= 1e-9 && weights.iter().all(|weight| *weight >= 0.0), "{weights:?}");
            true
        };
        assert!(at([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)]));
        assert!(at([(1.0, 1.0), (-2.0, -2.0), (1.0, 1.0), (-2.0, -2.0)]), "an edge across the axis");
        assert!(at([(0.0, 0.0); 4]), "a point on the axis");
        assert!(at([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 1.0)]), "a corner on the axis");
        assert!(!at([(0.3, 0.1); 4]), "one point beside the axis");
        assert!(!at([(1.0, 1.0), (2.0, 2.0), (1.0, 1.0), (2.0, 2.0)]), "an edge in line with the axis");
        assert!(!at([(1.0, 1.0), (2.0, -1.0), (3.0, 1.0), (1.0, -1.0)]), "all on one side");
        // Too low.
        let low = [Vector3::new(1.0, 0.0, 0.5), Vector3::new(-1.0, 0.0, 1.0), Vector3::z(), Vector3::z()];
        assert!(surrounding(&n, &x, &low, 1.0, 1e-9).is_none());
    }
}
