//! The least value of a smooth body's polynomial g over a set with a closed form, which is the
//! level distance of the body over the set, inside a proven bracket.
//!
//! Newton's method ([`super::level::Descent`]) keeps to the set. At a point y of it split the
//! gradient as `∇g = τ - ν`, ν a normal of the set at y, so that `ν·(x - y) <= 0` for its points x
//! and τ is what is left along it. By convexity
//!
//! ```text
//! g(x) >= g(y) + ∇g·(x - y)             >= g(y) - ∇g·y - h(-∇g)
//! g(x) >= g(y) + τ·(x - y) + m/2 |x - y|² >= g(y) - |τ|² / 2m
//! ```
//!
//! h the support function of the set and m the least curvature of g; where there is none, the first
//! line alone counts. Both are narrow once y has settled on its face, edge or corner.

use super::cuboid::Cuboid;
use super::cylinder::Cylinder;
use super::distance::interior;
use super::level::{Descent, Errors};
use super::placed::seen_from;
use super::projectable::{ON, Projectable};
use crate::body::{Body, ClosedForm, ExactShape};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{V3, add, dot, scaled, subtract};
use crate::measure::options::Options;
use crate::measure::solver::tangent_newton::{ALIGNED, Relative, SEEK_ROUNDS, Side, TAYLOR_ROUNDING};
use crate::polynomial::{NumberJet, Simd, WithSimd, gamma};
use nalgebra::Vector3;

/// A smooth body over one with a closed form; as vectorized work.
pub(in crate::measure) struct LevelQuery<'a> {
    /// With a single constraint.
    pub(in crate::measure) body: &'a Body,
    pub(in crate::measure) pose: &'a Pose,
    pub(in crate::measure) form: &'a ClosedForm,
    /// Of the body with the closed form.
    pub(in crate::measure) form_pose: &'a Pose,
    pub(in crate::measure) options: &'a Options<'a>,
    /// Minimiser of the answer before, frame of the body with the closed form, metres.
    pub(in crate::measure) from: Option<Vector3<f64>>,
}

/// A proven bracket and where it is attained, frame of the shape.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LevelMinimum {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    /// Point of the shape, metres.
    pub(in crate::measure) y: V3<f64>,
    /// Gradient of the polynomial there, 1/m.
    pub(in crate::measure) gradient: V3<f64>,
    /// The part of its opposite that is a normal of the shape there, 1/m.
    pub(in crate::measure) held: V3<f64>,
    /// Evaluations.
    pub(in crate::measure) rounds: u32,
}

impl WithSimd for LevelQuery<'_> {
    /// The answer, or the number of evaluations after which there is none: near the minimum of the
    /// polynomial, and where rounding keeps the bracket wide.
    type Output = Result<LevelMinimum, u32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let relative = seen_from(simd, self.form, self.form_pose, self.body, self.pose);
        match *self.form.shape() {
            ExactShape::Cuboid { half_extents_m, .. } => {
                self.solve(simd, &relative, Cuboid { half_extents: half_extents_m })
            }
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                self.solve(simd, &relative, Cylinder { radius: radius_m, half_height: half_height_m })
            }
            ExactShape::Capsule { .. } => Err(0),
        }
    }
}

impl LevelQuery<'_> {
    #[inline(always)]
    fn solve<S: Simd, P: Projectable>(&self, simd: S, relative: &Relative<f64>, set: P) -> Result<LevelMinimum, u32> {
        let side = Side::away(simd, self.body, 0, relative);
        let middle = interior(simd, self.body, relative);
        let from = match self.from {
            Some(own) => {
                let own = own - self.form.center();
                self.form.axes().map_or(own, |axes| axes.tr_mul(&own)).into()
            }
            None => middle,
        };
        let mut y = set.project(simd, from);
        let descent = Descent { set, side: &side };
        let (mut last, mut least) = (y, f64::INFINITY);
        let most = self.options.max_iterations().min(SEEK_ROUNDS);
        for round in 1..=most {
            if self.options.exhausted(round - 1) {
                return Err(round - 1);
            }
            let (jet, inside) = side.jet(simd, y);
            let gradient = side.gradient(simd, &jet);
            let (lower, upper) = self.bracket(simd, &descent, (&jet, inside), (y, gradient));
            let pull = scaled::<S, f64>(gradient, -1.0 / dot::<S, f64>(gradient, gradient).sqrt());
            // The point is off by the slide times the way to where the polynomial is lowest.
            let way = subtract::<S, f64>(y, middle);
            let far = dot::<S, f64>(way, way).sqrt().max(set.reach());
            let is_aligned = set.slide(simd, y, pull) <= (ALIGNED * set.reach() / far).max(4.0 * f64::EPSILON);
            if upper - lower <= self.options.accuracy() * upper.abs().max(1.0) && is_aligned {
                let normal = set.in_normal_cone(simd, set.feature_at(simd, y), pull);
                let held = scaled::<S, f64>(normal, -dot::<S, f64>(normal, gradient));
                return Ok(LevelMinimum { lower, upper, y, gradient, held, rounds: round });
            }
            if !(jet.value <= least) {
                y = scaled::<S, f64>(add::<S, f64>(y, last), 0.5);
                continue;
            }
            (last, least) = (y, jet.value);
            let next = descent.next(simd, y, &jet, gradient, round);
            // The set contains the minimiser of the polynomial, which is known of the body.
            let is_interior = set.feature_at(simd, y) == 0 && set.feature_at(simd, next) == 0;
            let step = subtract::<S, f64>(next, y);
            if is_interior && round > 2 || !(dot::<S, f64>(step, step) > 0.0) {
                return Err(round);
            }
            y = next;
        }
        Err(most)
    }

    /// Bounds of the least value at a point of the set with this jet and gradient.
    #[inline(always)]
    fn bracket<S: Simd, P: Projectable>(
        &self,
        simd: S,
        Descent { set, side }: &Descent<'_, P>,
        (jet, inside): (&NumberJet<f64>, bool),
        (y, gradient): (V3<f64>, V3<f64>),
    ) -> (f64, f64) {
        let trust = side.body().trust();
        let constraint = &trust.constraints[side.active];
        let errors = if inside { Errors::near(side) } else { Errors::at(side, side.normalized(simd, y)) };
        let displacement = self.form.displacement_m();
        // Points of the set are off it by a rounding or two.
        let off = displacement + errors.displacement + gamma(8) * set.reach();
        let length = dot::<S, f64>(gradient, gradient).sqrt();
        let gradient_error = errors.gradient + errors.turn * length;

        // Up to the point that y stands for.
        let bend = if inside && off <= trust.leeway {
            constraint.curvature_ceiling * off
        } else {
            errors.bend(side, side.normalized(simd, y), off)
        };
        let rise = (length + gradient_error + bend) * off * (1.0 + TAYLOR_ROUNDING);
        let upper = jet.value + errors.value + rise + TAYLOR_ROUNDING * jet.value.abs();

        let across = 2.0 * set.reach() + off;
        let beyond = -dot::<S, f64>(gradient, y) - set.height(simd, scaled::<S, f64>(gradient, -1.0));
        let pull = scaled::<S, f64>(gradient, -1.0 / length);
        let slide = length * (set.slide(simd, y, pull) + TAYLOR_ROUNDING) + gradient_error;
        let floor = constraint.curvature_floor;
        // A point that counts as on a face is off it by as much; twice for rounding.
        let off_face = 2.0 * (1.0 - ON) * set.reach();
        let bowl = slide * slide / (2.0 * floor) * (1.0 + TAYLOR_ROUNDING) + length * off_face;
        let linear = -beyond + gradient_error * across;
        let fall = if floor > 0.0 && bowl < linear { bowl } else { linear };
        let size = jet.value.abs() + length * (set.reach() + y[0].abs() + y[1].abs() + y[2].abs());
        let lower = jet.value - fall - errors.value - (length + gradient_error) * off - TAYLOR_ROUNDING * size;
        (lower, upper)
    }
}
