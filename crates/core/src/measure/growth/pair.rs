//! Growth distance of two bodies: continuation first, then a search about their common centre.

use super::answer::GrowthDistance;
use super::closed_form::of_shapes;
use super::minkowski_portal::crossing;
use super::problem::{Along, tolerance};
use crate::body::Body;
use crate::measure::bounds::duality_bounds::{DUALITY_ROUNDING, Multipliers, descent};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::solver::barrier_programs::split;
use crate::measure::solver::continuation::{Follow, Seek, Trace};
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::ray_program::{RayStart, ReachNewton, ReachProgram};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::support_table_gjk::corners;
use crate::measure::solver::tangent_newton::SEEK_ROUNDS;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::optimize::{Corner, minimise_within};
use crate::polynomial::{dispatch, gamma};
use nalgebra::Vector3;
use std::ops::ControlFlow;

/// Growth distance of two bodies.
pub(super) fn between(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    let mut spent = 0;
    if runs(Stage::ClosedForm) {
        match of_shapes((a, pose_a), (b, pose_b), options, warm) {
            Ok(found) => return found,
            Err(steps) => spent = steps,
        }
    }
    let found = by_search((a, pose_a), (b, pose_b), &options.after(spent), warm);
    GrowthDistance { iterations: found.iterations + spent, ..found }
}

/// Of bodies of any kind.
fn by_search(
    (a, pose_a): At<'_, Body>,
    (b, pose_b): At<'_, Body>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    let along = Along::new(a, pose_a, b, pose_b, options.accuracy());
    let mut spent = 0;
    if let Hint::Smooth(trace) = &mut warm.hint
        && along.is_sure()
        && runs(Stage::Follow)
    {
        match dispatch(Follow { a, b, relation: along, options, trace }) {
            Ok(proven) => return along.answer(a, pose_a, pose_b, &proven),
            Err(lost) => spent = lost.rounds,
        }
    }
    if runs(Stage::Seek) && a.is_smooth() && b.is_smooth() && along.is_sure() && !options.exhausted(spent) {
        let most = SEEK_ROUNDS.min(options.max_iterations() - spent);
        let mut trace = Trace::default();
        match dispatch(Seek { a, b, relation: along, from: None, most, options, trace: &mut trace }) {
            Ok(proven) => {
                warm.hint = Hint::Smooth(trace);
                let answer = along.answer(a, pose_a, pose_b, &proven);
                return GrowthDistance { iterations: spent + proven.rounds, ..answer };
            }
            Err(lost) => spent += lost.rounds,
        }
    }
    let (ball_a, ball_b) = (a.growth_ball(), b.growth_ball());
    let (arm_a, arm_b) = (pose_a.transform_direction(&ball_a.center), pose_b.transform_direction(&ball_b.center));
    // Only the orientation of the bodies matters to K: here their centres lie on each other.
    let (above_a, above_b) = (pose_a.with_translation(Vector3::zeros()), pose_b.with_translation(arm_a - arm_b));
    let pair = Pair::new(a, &above_a, b, &above_b);
    let apart = pose_b.translation() - pose_a.translation() + (arm_b - arm_a);
    let delta = pose_a.rotation().inverse_transform_vector(&apart) / pair.unit();
    let lengths =
        pose_a.translation().metric_distance(pose_b.translation()) + ball_a.center.norm() + ball_b.center.norm();
    let (center_a, center_b, center_error) = pair.growth_centers();
    let mut search = Search {
        frame: Frame {
            delta,
            delta_error: (2.0 * ROTATION_ERROR + gamma(32)) * lengths / pair.unit(),
            gap: delta.norm(),
            center_a,
            center_b,
            center_error,
            radius_a: ball_a.radius / pair.unit(),
            radius_b: ball_b.radius / pair.unit(),
            pair: &pair,
        },
        options,
        lower: 0.0,
        upper: f64::INFINITY,
        scale: 0.0,
        x: center_a,
        y: center_b,
        n: None,
        active: Default::default(),
        iterations: spent,
    };
    search.run(&warm.hint);
    if let Some(hint) = search.hint() {
        warm.hint = hint;
    }
    search.answer(pose_a, pose_b)
}

/// The bodies with their centres on top of each other, and the vector Δ between the centres where
/// they really are; query units, in the frame of the first body.
struct Frame<'a> {
    pair: &'a Pair<'a>,
    delta: Vector3<f64>,
    delta_error: f64,
    gap: f64,
    center_a: Vector3<f64>,
    center_b: Vector3<f64>,
    /// Bound of the error of either centre.
    center_error: f64,
    /// Radii of balls about the centres inside the bodies.
    radius_a: f64,
    radius_b: f64,
}

impl Frame<'_> {
    /// The point of K that x and y stand for.
    fn w(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> Vector3<f64> {
        (x - self.center_a) - (y - self.center_b)
    }

    /// Bound of the distance of `w(x, y)` from the point that points within the displacements of x
    /// and y stand for.
    fn w_error(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> f64 {
        let rounding = DUALITY_ROUNDING * (x.norm() + y.norm() + self.center_a.norm() + self.center_b.norm());
        self.pair.a.displacement(x) + self.pair.b.displacement(y) + 2.0 * self.center_error + rounding
    }

    /// `n·Δ / (H_A(n) + H_B(-n))`, rounded down; multipliers for n of A and for -n of B.
    fn lower(
        &self,
        x: &Vector3<f64>,
        y: &Vector3<f64>,
        n: &Vector3<f64>,
        of_a: &Multipliers,
        of_b: &Multipliers,
    ) -> f64 {
        let length = n.norm() * (1.0 + DUALITY_ROUNDING);
        let rise = n.dot(&self.delta) - length * (self.delta_error + DUALITY_ROUNDING * self.gap);
        let falls = descent(&self.pair.a, x, &-n, of_a) + descent(&self.pair.b, y, n, of_b);
        let width = n.dot(&self.w(x, y)) + falls + DUALITY_ROUNDING * falls.abs() + length * self.w_error(x, y);
        // A NaN bounds nothing.
        if rise > 0.0 && width > 0.0 { rise / width * (1.0 - DUALITY_ROUNDING) } else { 0.0 }
    }

    /// `t + |Δ - t w| / R`, rounded up, with its t, for points within whose displacements points of
    /// the bodies lie.
    fn upper(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> (f64, f64) {
        let w = self.w(x, y);
        let along = w.dot(&self.delta) / self.gap;
        let t = if along > 0.0 { self.gap / along } else { 0.0 };
        let rest =
            (self.delta - w * t).norm() + self.delta_error + t * self.w_error(x, y) + DUALITY_ROUNDING * self.gap;
        ((t + rest / (self.radius_a + self.radius_b)) * (1.0 + DUALITY_ROUNDING), t)
    }
}

/// A solve in progress: the best bracket so far and where it was attained.
struct Search<'a> {
    frame: Frame<'a>,
    options: &'a Options<'a>,
    lower: f64,
    upper: f64,
    /// Best t, and the points it belongs to.
    scale: f64,
    x: Vector3<f64>,
    y: Vector3<f64>,
    /// Normal of the best lower bound, from A to B, `n·u = 1`.
    n: Option<Vector3<f64>>,
    active: (Active, Active),
    iterations: u32,
}

impl Search<'_> {
    /// Whether the bracket is as narrow as asked for.
    fn done(&self) -> bool {
        let Frame { delta_error, radius_a, radius_b, .. } = self.frame;
        let tolerance = tolerance(self.options.accuracy(), self.upper, delta_error / (radius_a + radius_b));
        self.upper.is_finite() && self.upper - self.lower <= tolerance
    }

    /// Whether the bracket is narrow enough or no more may be done.
    fn ended(&self) -> bool {
        self.done() || self.options.exhausted(self.iterations)
    }

    fn run(&mut self, hint: &Hint) {
        let (x, y) = (self.x, self.y);
        self.attain(&x, &y);
        if !(self.frame.gap > 0.0) {
            // The centres coincide: s is 0 up to the error of knowing where they are.
            self.upper =
                self.frame.delta_error / (self.frame.radius_a + self.frame.radius_b) * (1.0 + DUALITY_ROUNDING);
            self.scale = 0.0;
            return;
        }
        let pair = self.frame.pair;
        if let Hint::Apart { x_a, y_b, normal_a, active_a, active_b } = hint
            && !self.ended()
        {
            let active = (Active::from_bits(*active_a, pair.a.len()), Active::from_bits(*active_b, pair.b.len()));
            if let (Some(a), Some(b)) = active {
                self.newton(pair.a_to_query(x_a), pair.b_to_query(y_b), &-normal_a, a, b);
            }
        }
        if !self.ended() {
            self.outlined();
        }
        if !self.ended() {
            self.interior_point(f64::INFINITY);
        }
        if !self.ended() {
            self.interior_point(1.0);
        }
    }

    /// Newton's method from where the ray leaves the difference of the outlines.
    fn outlined(&mut self) {
        if !runs(Stage::SupportTables) {
            return;
        }
        let pair = self.frame.pair;
        let support = |n: &Vector3<f64>| {
            let (x, y) = corners(pair, &-n);
            Corner { x, y, difference: self.frame.w(&x, &y) }
        };
        let found = crossing(&(self.frame.delta / self.frame.gap), support);
        for (x, y) in [(found.x, found.y), (found.x, found.corner.y), (found.corner.x, found.y)] {
            let (a, b) = (Active::near(&pair.a, &x, &found.n), Active::near(&pair.b, &y, &-found.n));
            self.newton(x, y, &found.n, a, b);
            if self.ended() || pair.smooth() {
                return;
            }
        }
    }

    /// Interior-point method, with Newton's method tried as soon as it shows the active
    /// constraints; for how far constraints may be violated see [`minimise_within`].
    fn interior_point(&mut self, farthest: f64) {
        if !runs(Stage::InteriorDistance) {
            return;
        }
        let pair = self.frame.pair;
        let program = ReachProgram::new(pair, &self.frame.delta, &self.frame.center_a, &self.frame.center_b);
        let mut v = program.start();
        let mut attempt = 1e-1;
        minimise_within(farthest, &program, &mut v, self.frame.radius_a + self.frame.radius_b, |iterate| {
            self.iterations += 1;
            let (x, y) = program.points(iterate.v);
            // Complementarity is the missing part of ρ.
            let relative = iterate.gap / iterate.v[0].abs().max(iterate.v[3].abs());
            if relative < attempt {
                attempt = relative * 1e-2;
                let (of_a, of_b) = split(pair, iterate.multipliers, 1.0);
                let normals = [pair.a.weighted_gradient(&x, &of_a), -pair.b.weighted_gradient(&y, &of_b)];
                for n in normals {
                    let lower = self.frame.lower(&x, &y, &n, &of_a, &of_b);
                    self.raise(lower, &n);
                }
                let (a, b) = (Active::from_multipliers(&of_a), Active::from_multipliers(&of_b));
                if self.attain(&x, &y) {
                    self.active = (a, b);
                }
                if !self.done() {
                    self.newton(x, y, &normals[0], a, b);
                }
            }
            if self.ended() || attempt < 1e-18 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }

    fn newton(&mut self, x: Vector3<f64>, y: Vector3<f64>, n: &Vector3<f64>, a: Active, b: Active) {
        if !runs(Stage::Ray) {
            return;
        }
        let u = self.frame.delta / self.frame.gap;
        let offset = self.frame.center_b - self.frame.center_a;
        let Some(mut newton) = ReachNewton::new(self.frame.pair, RayStart { u, offset, x, y, n: *n, a, b }) else {
            return;
        };
        let steps = newton.run(self.frame.pair, self.options, self.iterations, |at| {
            let lower = self.frame.lower(&at.x, &at.y, &at.n, &at.a.multipliers(), &at.b.multipliers());
            self.raise(lower, &at.n);
            if self.attain(&at.x, &at.y) {
                self.active = (at.a, at.b);
            }
            self.done()
        });
        self.iterations += steps;
    }

    fn raise(&mut self, lower: f64, n: &Vector3<f64>) {
        if lower > self.lower {
            (self.lower, self.n) = (lower, Some(*n));
        }
    }

    /// Pulls trial points into their bodies and takes them if they give the smallest s so far.
    fn attain(&mut self, x: &Vector3<f64>, y: &Vector3<f64>) -> bool {
        let (Some(x), Some(y)) = (self.frame.pair.a.move_inside(x), self.frame.pair.b.move_inside(y)) else {
            return false;
        };
        let (upper, scale) = self.frame.upper(&x, &y);
        let better = upper < self.upper;
        if better {
            (self.upper, self.scale, self.x, self.y) = (upper, scale, x, y);
        }
        better
    }

    fn hint(&self) -> Option<Hint> {
        let n = -self.n?.try_normalize(0.0)?;
        Some(Hint::apart(self.frame.pair, [&self.x, &self.y, &n], &self.active))
    }

    fn answer(&self, pose_a: &Pose, pose_b: &Pose) -> GrowthDistance {
        let Frame { pair, delta, center_a, radius_a, radius_b, .. } = &self.frame;
        let w = self.frame.w(&self.x, &self.y);
        // Of the rest Δ - t w, A's inscribed ball takes its share.
        let rest = (delta - w * self.scale) * (radius_a / (radius_a + radius_b));
        let arm = ((self.x - center_a) * self.scale + rest) * pair.unit();
        let center = pose_a.transform_point(&pair.to_a(center_a));
        let witness = center + pose_a.transform_direction(&arm);
        let slopes = self.n.map(|n| {
            // ∂s/∂Δ = n / (H_A(n) + H_B(-n)) = s n / (n·Δ).
            let slope = n * (self.upper / n.dot(delta) / pair.unit());
            pair.direction_to_world(&slope)
        });
        let width = self.upper - self.lower;
        let narrow = self.upper.is_finite() && width <= self.options.accuracy() * self.upper.max(1.0);
        GrowthDistance {
            status: Status::of(narrow),
            lower: self.lower,
            upper: self.upper,
            witness,
            normal: slopes.and_then(|slope| (-slope).try_normalize(0.0)),
            gradients: slopes.map(|slope| {
                [
                    Twist::of_gradient(-slope, &witness, pose_a.translation()),
                    Twist::of_gradient(slope, &witness, pose_b.translation()),
                ]
            }),
            tied: false,
            iterations: self.iterations,
        }
    }
}
