//! Growth distance: how much two bodies must grow about their centres to touch (Ong and Gilbert,
//! Growth distances: new measures for object separation and penetration, IEEE Trans. Robotics and
//! Automation 12, 1996).
//!
//! With `Δ = c_B - c_A` between the centres, `c_A + s (A - c_A)` and `c_B + s (B - c_B)` meet if
//! and only if `Δ / s` lies in `K = (A - c_A) - (B - c_B)`. So s is the gauge of K at Δ: along the
//! unit vector `u = Δ/|Δ|` one looks for the longest
//!
//! ```text
//! ρ u = (x - c_A) - (y - c_B),   x in A, y in B,   and s = |Δ| / ρ.
//! ```
//!
//! K does not depend on where the bodies are, only on how they are turned: the program is posed
//! with the centres put on top of each other, so neither far nor deep pairs lose digits. With the
//! support functions H about the centres and an inscribed ball of K of radius R, for every vector
//! n, every w in K and every t >= 0
//!
//! ```text
//! n·Δ / (H_A(n) + H_B(-n)) <= s <= t + |Δ - t w| / R,
//! ```
//!
//! the left by duality, the right because a gauge is subadditive.

mod minkowski_portal;
mod problem;
mod ray_program;
#[cfg(test)]
mod tests;

use crate::body::{Body, Solid};
use crate::measure::Status;
use crate::measure::bounds::duality_bounds::{Multipliers, SLACK, descent};
use crate::measure::distance::split;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::solver::continuation::{Follow, SEEK_ROUNDS, Seek};
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::support_table_gjk::corners;
use crate::measure::union;
use crate::measure::warm::{Hint, WarmStart};
use crate::optimize::{Corner, minimise_within};
use crate::polynomial::{dispatch, gamma};
use minkowski_portal::crossing;
use nalgebra::Vector3;
use problem::Along;
pub(in crate::measure) use ray_program::ReachNewton;
use ray_program::ReachProgram;
use std::ops::ControlFlow;

/// Growth distance with its proof; unit-free, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct GrowthDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound.
    pub lower: f64,
    /// Proven upper bound, attained by the witness.
    pub upper: f64,
    /// A point of both bodies grown by `upper`, metres: where they touch.
    pub witness: Vector3<f64>,
    /// Unit normal of the contact, from the second body to the first; none if the centres coincide
    /// as far as doubles can tell.
    pub normal: Option<Vector3<f64>>,
    /// Derivatives with respect to the twists of the first and of the second body (1/m and 1/rad),
    /// one of them where they are not unique; none if the centres coincide as far as doubles can
    /// tell.
    pub gradients: Option<[Twist; 2]>,
    /// Whether another pair of parts may be as soon to touch, their brackets meeting: normal,
    /// witness and gradients may then jump. Never for single bodies.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl GrowthDistance {
    /// The answer inside the bracket: the upper bound, which the witness attains.
    pub fn value(&self) -> f64 {
        self.upper
    }
}

/// Growth distance of two bodies at their poses (body to world): the smallest s at which `c_A + s
/// (A - c_A)` and `c_B + s (B - c_B)` touch, about the centres of [`Body::growth_ball`]. Above 1
/// the bodies are apart, at 1 they touch, below 1 they overlap, at 0 their centres coincide.
/// Symmetric, and informative however deep the overlap.
///
/// The bracket is as narrow as `options` ask, relative to `max(1, s)`, or the status says that it
/// is not. `warm` is read and then replaced by the hint for the next query of this pair.
///
/// Of solids with several parts it is the least over the pairs of parts, each of which grows about
/// its own centre: the smallest s at which a grown part of `a` touches a grown part of `b`. About
/// one common centre it would not be a measure of proximity: a union is not star-shaped about any
/// point in general, so it does not grow in place, may leave what it touched before, and would not
/// tell overlap by s < 1. Parts that contain their centres only ever grow, so that here, too, s > 1
/// if and only if the solids are apart. It depends on how a solid is cut into parts.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Options, Pose, WarmStart, growth_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let pose = Pose::from_quaternion(Vector3::new(0.75, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let s = growth_distance(&crate_, &Pose::identity(), &ball, &pose, &Options::default(), &mut WarmStart::default());
/// assert!((s.value() - 0.5).abs() < 1e-9); // half a crate and half a ball meet at x = 0.5
///
/// let row = Compound::new("row", vec![crate_, Body::ball("far", Vector3::new(-5.0, 0.0, 0.0), 0.5)?])?;
/// let t = growth_distance(&row, &Pose::identity(), &ball, &pose, &Options::default(), &mut WarmStart::default());
/// assert!((t.value() - s.value()).abs() < 1e-9 && !t.tied); // the crate is the first to touch
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn growth_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    union::growth_distance(a, pose_a, b, pose_b, options, warm)
}

/// Growth distance of two bodies.
pub(super) fn between(
    a: &Body,
    pose_a: &Pose,
    b: &Body,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> GrowthDistance {
    let along = Along::new(a, pose_a, b, pose_b, options.accuracy());
    let mut spent = 0;
    if let Hint::Smooth(trace) = &mut warm.hint
        && along.is_sure()
    {
        match dispatch(Follow { a, b, relation: along, options, trace }) {
            Ok(proven) => return along.answer(a, pose_a, pose_b, &proven),
            Err(lost) => spent = lost.rounds,
        }
    }
    if a.is_smooth() && b.is_smooth() && along.is_sure() && !options.exhausted(spent) {
        let most = SEEK_ROUNDS.min(options.max_iterations() - spent);
        match dispatch(Seek { a, b, relation: along, from: None, most, options }) {
            Ok((proven, trace)) => {
                *warm = Hint::Smooth(trace).into();
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
        *warm = hint;
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
        let rounding = SLACK * (x.norm() + y.norm() + self.center_a.norm() + self.center_b.norm());
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
        let length = n.norm() * (1.0 + SLACK);
        let rise = n.dot(&self.delta) - length * (self.delta_error + SLACK * self.gap);
        let falls = descent(&self.pair.a, x, &-n, of_a) + descent(&self.pair.b, y, n, of_b);
        let width = n.dot(&self.w(x, y)) + falls + SLACK * falls.abs() + length * self.w_error(x, y);
        // A NaN bounds nothing.
        if rise > 0.0 && width > 0.0 { rise / width * (1.0 - SLACK) } else { 0.0 }
    }

    /// `t + |Δ - t w| / R`, rounded up, with its t, for points within whose displacements points of
    /// the bodies lie.
    fn upper(&self, x: &Vector3<f64>, y: &Vector3<f64>) -> (f64, f64) {
        let w = self.w(x, y);
        let along = w.dot(&self.delta) / self.gap;
        let t = if along > 0.0 { self.gap / along } else { 0.0 };
        let rest = (self.delta - w * t).norm() + self.delta_error + t * self.w_error(x, y) + SLACK * self.gap;
        ((t + rest / (self.radius_a + self.radius_b)) * (1.0 + SLACK), t)
    }
}

/// Width of a bracket that is narrow enough. It is relative to s, as normals of deep pairs need as
/// much; but the vector between centres that all but coincide is known to `error` of the bodies
/// only, and what that makes of either bound no method takes off.
#[inline(always)]
fn tolerance(accuracy: f64, upper: f64, error: f64) -> f64 {
    (accuracy * upper + 2.0 * error).min(accuracy * upper.max(1.0))
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
            self.upper = self.frame.delta_error / (self.frame.radius_a + self.frame.radius_b) * (1.0 + SLACK);
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
                let normals = [gradient(&pair.a, &x, &of_a), -gradient(&pair.b, &y, &of_b)];
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
        let u = self.frame.delta / self.frame.gap;
        let offset = self.frame.center_b - self.frame.center_a;
        let Some(mut newton) = ReachNewton::new(self.frame.pair, u, offset, x, y, n, a, b) else { return };
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
        let (Some(x), Some(y)) = (self.frame.pair.a.pull_in(x), self.frame.pair.b.pull_in(y)) else { return false };
        let (upper, scale) = self.frame.upper(&x, &y);
        let better = upper < self.upper;
        if better {
            (self.upper, self.scale, self.x, self.y) = (upper, scale, x, y);
        }
        better
    }

    fn hint(&self) -> Option<WarmStart> {
        let n = -self.n?.try_normalize(0.0)?;
        Some(WarmStart::apart(self.frame.pair, &self.x, &self.y, &n, self.active.0.bits(), self.active.1.bits()))
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
            status: if narrow { Status::Converged } else { Status::BracketWide },
            lower: self.lower,
            upper: self.upper,
            witness,
            normal: slopes.and_then(|slope| (-slope).try_normalize(0.0)),
            gradients: slopes.map(|slope| {
                [
                    Twist::of_force(-slope, &witness, pose_a.translation()),
                    Twist::of_force(slope, &witness, pose_b.translation()),
                ]
            }),
            tied: false,
            iterations: self.iterations,
        }
    }
}

/// `Σ λ_i ∇g_i(v)`.
fn gradient(body: &Posed<'_>, v: &Vector3<f64>, multipliers: &Multipliers) -> Vector3<f64> {
    (0..body.len()).map(|i| body.jet(i, v).gradient * multipliers[i]).sum()
}
