//! What Newton's method for the level distance proves at the end of a step; see [`super`].

use super::sides::{Evaluated, Sides, Step};
use crate::measure::frames::vector::{
    V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, scaled,
};
use crate::measure::solver::tangent_newton::{ALIGNED, NUDGE, TAYLOR_ROUNDING};
use crate::polynomial::{NEAR_LEVEL, Scalar, Simd, gamma};
use nalgebra::Vector3;

/// Slope of p per length of A, dimensionless, below which the gradient of an answer is compared
/// with this slope instead of its own norm.
///
/// Smaller, nothing is accepted near the minimum of p, where gradients vanish; larger, gradients
/// are accepted that are off by more. Exercised by `gradients_are_the_derivatives_of_the_value`.
const LEAST_GRADIENT: f64 = 1e-3;

/// Longest step that bounds are made for: relative to the distance from A's centre, or to B;
/// dimensionless.
///
/// Larger, bounds of third derivatives grow with the ball they are for; smaller, brackets wait for
/// shorter steps. `stages_of_level_distances_solve_alone` counts what is solved.
pub(super) const ROOM: f64 = 1.0 / 16.0;

/// How steps of w are measured: by a norm that bounds their lengths in both bodies' normalized
/// coordinates.
pub(super) struct Metric {
    /// Bound of `|C d|` by the norm of d.
    of_a: f64,
    /// Bound of `|d|`.
    of_b: f64,
    /// Lower bound of the smallest curvature by the norm's square, but for the errors of the
    /// Hessian's entries.
    curvature: f64,
    /// Bound of the norm of a step by its length in metres.
    per_metre: f64,
}

impl Metric {
    /// B's normalized coordinates.
    #[inline(always)]
    pub(super) fn of_b(sides: &Sides<'_>, curvature: f64) -> Self {
        Self { of_a: sides.map.spread, of_b: 1.0, curvature, per_metre: sides.b.trust().linear_norm }
    }
}

/// A bracket at the end of a step.
pub(super) struct Bracket {
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// From there to a point of B, by w.
    pub(super) inward: V3<f64>,
    /// Gradient of A's constraint in A's frame, per metre.
    pub(super) gradient: V3<f64>,
    /// Gradient of B's constraint, by w.
    pub(super) gradient_b: V3<f64>,
    pub(super) multiplier: f64,
    /// Whether the gradients oppose each other well enough for gradients of the answer.
    pub(super) aligned: bool,
}

impl Bracket {
    #[inline(always)]
    pub(super) fn proves(&self, accuracy: f64) -> bool {
        self.upper - self.lower <= accuracy * self.upper.abs().max(1.0) && self.aligned
    }
}

impl Sides<'_> {
    /// The metric that counts lengths in both bodies' normalized coordinates, `|d|² + |C d|²`:
    /// however thin a body is, none of its bounds suffers from how long a step across it is in the
    /// coordinates of the other.
    pub(super) fn joint(&self, at: &Evaluated) -> Metric {
        let spread = self.map.spread;
        let n = self.map.metric(1.0, 1.0);
        let (_, multiplier) = self.balance(Scalar, &at.jet_a, &at.jet_b);
        let h = self.hessian(Scalar, &at.jet_a, &at.jet_b, multiplier);
        let (of_n, det_n) = cofactors(Scalar, n);
        let (_, det_h) = cofactors(Scalar, h);
        let trace = |m: &[f64; 6]| m[0] + m[3] + m[5];
        let rounding = 64.0 * f64::EPSILON;
        // Of the eigenvalues of N⁻¹H the smallest is at least the determinant over the square of
        // half the trace.
        let (trace_n, trace_h) = (trace(&n), trace(&h));
        let mixed = of_n[0] * h[0] + of_n[3] * h[3] + of_n[5] * h[5];
        let mixed = mixed + 2.0 * (of_n[1] * h[1] + of_n[2] * h[2] + of_n[4] * h[4]);
        let least_n = det_n - rounding * trace_n.powi(3);
        let half_trace = 0.5 * (mixed + rounding * trace_n * trace_n * trace_h) / least_n;
        let ratio = (det_h - rounding * trace_h.powi(3)) / (det_n + rounding * trace_n.powi(3));
        // The entries of N are rounded, too.
        let kept = 1.0 - rounding * trace_n;
        let curvature = if least_n > 0.0 && kept > 0.5 { ratio / (half_trace * half_trace) } else { 0.0 };
        let kept = kept.max(0.5);
        Metric {
            of_a: spread / (kept + spread * spread).sqrt() * (1.0 + 1e-12),
            of_b: (1.0 / kept).sqrt() * (1.0 + 1e-12),
            curvature,
            per_metre: self.a.trust().linear_norm.hypot(self.b.trust().linear_norm),
        }
    }

    /// The bracket at the end of a step, with lengths of steps in a metric; NaN where nothing is
    /// proven.
    #[inline(always)]
    pub(super) fn bracket<S: Simd>(&self, _: S, at: &Evaluated, step: &Step, metric: &Metric) -> Bracket {
        let Self { map, .. } = self;
        let (trust_a, trust_b) = (self.a.trust(), self.b.trust());
        let norm = |v: V3<f64>| dot::<S, f64>(v, v).sqrt();
        let sum = |v: V3<f64>| v[0].abs() + v[1].abs() + v[2].abs();

        // A at the end of the step, with errors that are valid as far again.
        let dz = apply::<S, f64>(&map.both, step.delta);
        let bent = apply_symmetric::<S, f64>(&at.jet_a.hessian, dz);
        let value_a = at.jet_a.value + dot::<S, f64>(dz, add_scaled::<S, f64>(at.jet_a.gradient, 0.5, bent));
        let gradient_z = add::<S, f64>(at.jet_a.gradient, bent);
        let length = norm(at.z);
        let room = ROOM * if length > trust_a.radius { length } else { trust_a.radius };
        let coordinate = at.z.iter().fold(0.0_f64, |most, entry| if entry.abs() > most { entry.abs() } else { most });
        let growth = self.p.growth(coordinate + 2.0 * room, length + 2.0 * room);
        let step_a = norm(dz);
        let half_third_a = 0.5 * growth.third * step_a * step_a * (1.0 + 1e-12);
        let error_a = growth.value_error + half_third_a * step_a * (1.0 / 3.0 + 1e-9);
        // 1.8 > √3.
        let gradient_error = 1.8 * growth.gradient_error + half_third_a + gamma(16) * sum(gradient_z);
        let gradient = apply_transposed::<S, f64>(&map.to_a, gradient_z);
        let slope = norm(gradient) * (1.0 + 1e-14) + trust_a.linear_norm * gradient_error;
        let gradient_a = apply_transposed::<S, f64>(&map.linear, gradient);
        let displaced = map.displacement + map.rounding * sum(at.x);
        let trace = |h: &[f64; 6]| h[0] + h[3] + h[5];
        let (trace_a, trace_b) = (trace(&at.jet_a.hessian), trace(&at.jet_b.hessian));
        let ceiling_a = trace_a + growth.third * 2.0 * room + growth.curvature_error;
        let spread = map.spread;
        let rounded = gamma(16) * trust_a.linear_norm * trust_b.inverse_norm * sum(gradient_z);
        // In z, and what is added by the map, in w.
        let z_error = gradient_error + ceiling_a * trust_a.linear_norm * displaced;
        let w_error = slope * map.turn + rounded;
        let pulled_error = spread * z_error + w_error;

        // B at the end of the step.
        let bent = apply_symmetric::<S, f64>(&at.jet_b.hessian, step.delta);
        let value_b = at.jet_b.value + dot::<S, f64>(step.delta, add_scaled::<S, f64>(at.jet_b.gradient, 0.5, bent));
        let b = add::<S, f64>(at.jet_b.gradient, bent);
        let third = self.trust.third;
        let room_b = (0.5 * third.leeway).min(ROOM * trust_b.radius);
        let step_b = norm(step.delta);
        let half_third_b = 0.5 * third.ceiling * step_b * step_b * (1.0 + 1e-12);
        // Four times: twice for Taylor's formula, and (17/16)⁸ < 2 for the step out of the ball.
        let error_b = 4.0 * self.trust.value_error + half_third_b * step_b * (1.0 / 3.0 + 1e-9);
        let b_error = 4.0 * self.trust.gradient_error / trust_b.linear_norm + half_third_b;

        // Lower bound.
        let square = dot::<S, f64>(b, b);
        let inverse = 1.0 / square.sqrt();
        let multiplier = -dot::<S, f64>(gradient_a, b) * (inverse * inverse);
        let (of_a, of_b) = (metric.of_a, metric.of_b);
        let rest = norm(add_scaled::<S, f64>(gradient_a, multiplier, b))
            + (w_error + multiplier * b_error)
            + TAYLOR_ROUNDING * sum(gradient_a);
        let off = of_a * z_error + of_b * rest;
        let entries = of_a * of_a * growth.curvature_error
            + trace_a
                * trust_a.linear_norm
                * (3.0 * of_a * of_b * map.turn + gamma(64) * of_b * of_b * spread * trust_b.inverse_norm)
            + step.multiplier * of_b * of_b * (self.trust.curvature_error + gamma(64) * trace_b);
        let bending_a = growth.third * of_a * of_a;
        let bending_b = multiplier * third.ceiling * of_b * of_b;
        let bending = bending_a * of_a + bending_b * of_b;
        let kept = if multiplier < step.multiplier { multiplier / step.multiplier } else { 1.0 };
        let curvature = kept * (metric.curvature - entries) - (bending_a * step_a + bending_b * step_b);
        let reach = (room_b / of_b).min(room / of_a);
        // Second derivatives decrease by at most `bending` per length.
        let slope_there =
            0.25 * curvature * if 1.5 * curvature < bending * reach { 1.5 * curvature / bending } else { reach };
        let span_b = trust_b.radius * (1.0 + ROOM) + self.b.z_extent().norm() * (1.0 + 1e-14);
        let slack =
            TAYLOR_ROUNDING * (value_a.abs() + multiplier * (1.0 + value_b.abs()) + error_a) + slope * displaced;

        // Upper bound: into B along b, as far as its curvature may require.
        let excess = value_b - 1.0 + error_b;
        let ceiling = trace_b + third.ceiling * (step_b + room_b) + 2.0 * self.trust.curvature_error;
        let q = ceiling * excess.abs() * inverse * inverse * (1.0 + 1e-9);
        let distance = (excess + excess.abs() * (2.0 * q + NUDGE)) * inverse;
        let moved = distance.abs();
        let lift = spread * moved + trust_a.linear_norm * displaced;
        let upper = value_a
            + error_a
            + distance * multiplier * square * inverse
            + (moved * pulled_error + 0.5 * ceiling_a * lift * lift)
            + slack
            + TAYLOR_ROUNDING * moved * sum(gradient_a);

        // Only the minimiser counts, where A's polynomial is at most `upper`: by convexity A,
        // scaled about its interior point by this, contains all such points.
        let scale = ((upper - self.a.min_value()) / (1.0 - self.a.min_value())).max(1.0);
        let extent = self.a.z_extent().norm() * (1.0 + 1e-9);
        let span_a = (spread * span_b).min(length + step_a + (1.0 + 2.0 * scale) * extent);
        let linear = z_error * span_a + rest * span_b;
        let loss = if curvature > 0.0 && off <= slope_there { (off * off / curvature).min(linear) } else { linear };
        let fall = multiplier * (value_b - 1.0 - error_b);
        let slack = slack + TAYLOR_ROUNDING * loss;
        let lower = value_a - error_a + fall - loss - slack;

        let inside = dot::<S, f64>(at.w, at.w) <= trust_b.radius * trust_b.radius
            && (at.jet_b.value - 1.0).abs() <= NEAR_LEVEL
            && step_b <= room_b
            && moved <= room_b
            && step_a <= room
            && lift <= room
            && multiplier >= 0.0
            && q <= 0.1
            && b_error * (4.0 / NUDGE) * inverse <= 1.0;
        // The point has yet to move into B, which turns the gradient, too.
        let least = LEAST_GRADIENT / trust_a.inverse_norm;
        let turned = off + of_a * trace_a * spread * moved;
        let aligned = turned * metric.per_metre <= ALIGNED * if slope > least { slope } else { least };
        Bracket {
            lower: if inside { lower } else { f64::NAN },
            upper,
            inward: scaled::<S, f64>(b, -distance * inverse),
            gradient,
            gradient_b: b,
            multiplier,
            aligned,
        }
    }

    /// Whether at the point w of B's normalized coordinates the other constraints of B are proven
    /// to hold, and those of A not to exceed `upper`.
    #[inline(always)]
    pub(super) fn others_hold<S: Simd>(&self, simd: S, w: V3<f64>, upper: f64) -> bool {
        let [active_a, active_b] = self.active.map(usize::from);
        let mut hold = true;
        let (trust_a, trust_b) = (self.a.trust(), self.b.trust());
        if self.b.constraints().len() > 1 {
            hold &= dot::<S, f64>(w, w) <= trust_b.radius * trust_b.radius;
            for (i, constraint) in self.b.constraints().iter().enumerate().filter(|(i, _)| *i != active_b) {
                // Twice: w itself is rounded.
                hold &= constraint.polynomial.jet(simd, w).value + 2.0 * trust_b.constraints[i].value_error <= 1.0;
            }
        }
        if self.a.constraints().len() > 1 {
            let x = self.map.apply(simd, w);
            let z = Vector3::from(self.map.to_a(simd, x));
            let far = x[0].abs() + x[1].abs() + x[2].abs();
            let dz = Vector3::repeat(trust_a.linear_norm * (self.map.displacement + self.map.rounding * far));
            for (_, constraint) in self.a.constraints().iter().enumerate().filter(|(i, _)| *i != active_a) {
                let jet = constraint.polynomial.jet(simd, z.into());
                hold &= jet.value + constraint.polynomial.value_error(&z, &Vector3::from(jet.gradient), &dz) < upper;
            }
        }
        hold
    }
}
