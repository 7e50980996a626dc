//! A ray in the normalized coordinates of a body, and what an evaluation on it proves.

use super::approach::Approach;
use super::ray::Ray;
use crate::body::{Body, MAX_CONSTRAINTS};
use crate::measure::frames::pose::Pose;
use crate::measure::solver::convex_root_bracket::Entry;
use crate::measure::solver::stages::{Stage, runs};
use crate::polynomial::{Polynomial, gamma};
use nalgebra::Vector3;

/// A ray in the normalized coordinates of a body: `z(τ) = z_0 + τ ż`.
pub(super) struct NormalizedRay<'a> {
    body: &'a Body,
    /// Parameter of the ray at τ = 0, metres.
    pub(super) base: f64,
    start: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Bounds of the errors of the components of z and of ż.
    start_error: Vector3<f64>,
    velocity_error: Vector3<f64>,
    /// Bounds of the error of the value, but for that by the error of z to first order, and of each
    /// component of the gradient, of each constraint.
    errors: [(f64, f64); MAX_CONSTRAINTS],
}

/// The result of one evaluation.
pub(super) struct Look {
    pub(super) inside: bool,
    /// Where the entry is expected.
    pub(super) guess: f64,
    /// Gradient of the largest constraint in the body frame.
    pub(super) normal: Vector3<f64>,
}

impl<'a> NormalizedRay<'a> {
    /// The ray and the interval of τ where it is in the circumscribed ball and within the bounds of
    /// the normalized coordinates; none if there is no such τ.
    pub(super) fn new(body: &'a Body, pose: &Pose, ray: &Ray) -> Option<(Self, Entry)> {
        let (ball, center) = (body.circumscribed(), body.normalization().center);
        let Approach { base, closest, direction, errors: (moved, relative), mut entry } =
            Approach::within(ball.radius, &ball.center, pose, ray)?;
        let moved = moved + gamma(8) * center.norm();
        let reach = ball.radius * (1.0 + 1e-14) + moved;

        let linear = &body.normalization().linear;
        let from_center = closest + (ball.center - center);
        let (start, velocity) = (linear * from_center, linear * direction);
        let rows = body.placement().row_norms();
        let start_error = rows * (moved + gamma(8) * (from_center.norm() + 2.0 * reach)) * (1.0 + 1e-14);
        let velocity_error = rows * relative;
        // The slabs of the normalized coordinates, wider by what the line may be off in the ball.
        let far = entry.from.abs().max(entry.to.abs());
        let extent = body.z_extent() + start_error;
        let slab = (extent + velocity_error * far) * (1.0 + 1e-14);
        for i in 0..3 {
            if velocity[i] == 0.0 && start[i].abs() <= slab[i] {
                continue;
            }
            let [one, other] = [-slab[i], slab[i]].map(|side| (side - start[i]) / velocity[i]);
            entry.clip(one.min(other), one.max(other));
        }
        if entry.missed() {
            return None;
        }
        let mut errors = [(0.0, 0.0); MAX_CONSTRAINTS];
        let corner = extent * (1.0 + 1e-6);
        for (constraint, errors) in body.constraints().iter().zip(&mut errors) {
            let polynomial = &constraint.polynomial;
            *errors = (
                polynomial.value_error(&corner, &Vector3::zeros(), &start_error),
                polynomial.gradient_error(&corner, &start_error),
            );
        }
        Some((Self { body, base, start, velocity, start_error, velocity_error, errors }, entry))
    }

    /// The first trial parameter: the start of a ray that may start inside, else where the last
    /// constraint is entered, as values along the ray have it.
    pub(super) fn first(&self, entry: &Entry, beyond: f64) -> f64 {
        if entry.from <= -self.base || !runs(Stage::Interpolation) {
            return entry.from;
        }
        let (middle, half) = (0.5 * (entry.from + entry.to), 0.5 * (entry.to - entry.from));
        let (z, step) = (self.start + self.velocity * middle, self.velocity * half);
        let entered = |polynomial: &Polynomial| middle + half * polynomial.first_below_along(&z, &step, 1.0);
        let last = self.body.constraints().iter().map(|c| entered(&c.polynomial)).fold(entry.from, f64::max);
        // Beyond the interval nothing is proven.
        (last + beyond).min(entry.to)
    }

    /// All constraints at τ = s: cuts the interval with their tangents.
    #[inline]
    pub(super) fn look(&self, s: f64, entry: &mut Entry) -> Look {
        let z = self.start + self.velocity * s;
        let mut look = Look { inside: true, guess: f64::NEG_INFINITY, normal: Vector3::zeros() };
        let mut largest = f64::NEG_INFINITY;
        let depth = 1.0 - self.body.min_value();
        for (constraint, (value_error, gradient_error)) in self.body.constraints().iter().zip(&self.errors) {
            let jet = constraint.polynomial.evaluate(&z);
            let magnitudes = jet.gradient.abs();
            let value = jet.value - 1.0;
            let slope = jet.gradient.dot(&self.velocity);
            let value_error = (value_error + magnitudes.dot(&self.start_error)) * (1.0 + 1e-14) + 2e-16 * value.abs();
            let slope_error = (gradient_error * self.velocity.abs().sum()
                + magnitudes.add_scalar(*gradient_error).dot(&self.velocity_error)
                + gamma(4) * magnitudes.dot(&self.velocity.abs()))
                * (1.0 + 1e-14);
            // Not `>`: a NaN is not inside.
            look.inside &= value + value_error <= 0.0;
            entry.cut(s, value - value_error, slope - slope_error, slope + slope_error);
            let curvature = self.velocity.dot(&(jet.hessian * self.velocity));
            if slope < 0.0 {
                look.guess = look.guess.max(s + step(value, slope, curvature, depth));
            } else if value > 0.0 {
                // Beyond the lowest point: the next guess is there.
                look.guess = look.guess.max(s - slope / curvature);
            }
            if value > largest {
                (largest, look.normal) = (value, jet.gradient);
            }
        }
        look.normal = self.body.normalization().linear.tr_mul(&look.normal);
        look
    }
}

/// Step from a point with this value `f - 1`, negative slope and curvature to the root of a model
/// of f, or to its lowest point if it has no root.
///
/// Near the surface the model is the quadratic with these derivatives; far outside it is the power
/// `(σ - s)^j` above the least value `1 - depth`, which the terms of highest degree make of f
/// there.
#[inline]
fn step(value: f64, slope: f64, curvature: f64, depth: f64) -> f64 {
    let above = value + depth;
    if value > depth {
        let power = (1.0 / (1.0 - above * curvature / (slope * slope))).clamp(1.0, 8.0);
        return power * above / -slope * (1.0 - (depth / above).powf(1.0 / power));
    }
    let discriminant = slope * slope - 2.0 * value * curvature;
    if discriminant >= 0.0 { 2.0 * value / (discriminant.sqrt() - slope) } else { -slope / curvature }
}
