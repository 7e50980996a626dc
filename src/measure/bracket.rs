//! Brackets proven for any trial point: lower bounds by convexity and Lagrange duality, upper bounds by feasible points.
//!
//! With n a unit vector, λ, μ >= 0, and ρ bounding the distance from the trial point to any point of the body:
//!
//! ```text
//! D >= n·(x - y) - Σ λ_i (1 - g_i(x)) - Σ μ_j (1 - h_j(y)) - |n + Σ λ_i ∇g_i(x)| ρ_A - |n - Σ μ_j ∇h_j(y)| ρ_B
//! d >= Σ ν_i g_i(x) + Σ μ_j (h_j(x) - 1) - |Σ ν_i ∇g_i(x) + Σ μ_j ∇h_j(x)| ρ_B,   ν >= 0, Σ ν = 1
//! ```
//!
//! Both follow from `g(x') >= g(x) + ∇g(x)·(x' - x)` summed over the constraints. Errors of values and gradients
//! ([`crate::body::Sample`]) enter with the sign that loses. The samples are exact for points displaced by at most δ_A, δ_B
//! from the trial points ([`crate::body::Placement::displacement`]): distances lose or gain the displacements, level
//! distances those times |Σ ν_i ∇g_i|. The few dozen roundings of the sums themselves are covered by a relative slack on the
//! sum of magnitudes.

use super::pair::{Pair, Posed};
use crate::body::MAX_CONSTRAINTS;
use nalgebra::Vector3;

/// Relative slack for the rounding of a bound's own arithmetic: fewer than 128 operations on the sum of magnitudes.
const SLACK: f64 = 64.0 * f64::EPSILON;

/// Multipliers of the constraints of one body; zero where inactive.
pub(super) type Multipliers = [f64; MAX_CONSTRAINTS];

/// `Σ λ_i (1 - g_i)` rounded up, `Σ λ_i ∇g_i`, a bound of the gradient sum's error, and the magnitude of the first sum.
struct Weighted {
    slack: f64,
    gradient: Vector3<f64>,
    gradient_error: f64,
    magnitude: f64,
}

fn weigh(body: &Posed<'_>, v: &Vector3<f64>, multipliers: &Multipliers) -> Weighted {
    let mut sum = Weighted { slack: 0.0, gradient: Vector3::zeros(), gradient_error: 0.0, magnitude: 0.0 };
    for (i, &multiplier) in multipliers.iter().enumerate().take(body.len()) {
        if multiplier > 0.0 {
            let sample = body.sample(i, v);
            sum.slack += multiplier * (1.0 - sample.jet.value + sample.nearby_value_error);
            sum.gradient += sample.jet.gradient * multiplier;
            sum.gradient_error += multiplier * (sample.gradient_error + SLACK * sample.jet.gradient.norm());
            sum.magnitude += multiplier * (1.0 + sample.jet.value.abs());
        }
    }
    sum
}

/// Lower bound of the distance in query units, from trial points x and y, a direction `n` from B to A (normalized here) and
/// multipliers of both bodies for it. Never below 0, which is always a bound.
pub(super) fn distance_lower(
    pair: &Pair<'_>,
    x: &Vector3<f64>,
    y: &Vector3<f64>,
    n: &Vector3<f64>,
    of_a: &Multipliers,
    of_b: &Multipliers,
) -> f64 {
    let n = n / n.norm();
    let a = weigh(&pair.a, x, of_a);
    let b = weigh(&pair.b, y, of_b);
    let leading = n.dot(&(x - y));
    let rest = ((n + a.gradient).norm() + a.gradient_error) * pair.a.reach(x)
        + ((n - b.gradient).norm() + b.gradient_error) * pair.b.reach(y);
    // n is a unit vector up to 4 roundings: the slack on the leading term and on the reaches covers them.
    let magnitude = x.norm() + y.norm() + a.magnitude + b.magnitude + rest;
    let slack = SLACK * (magnitude + pair.a.reach(x) + pair.b.reach(y));
    let displaced = (pair.a.displacement(x) + pair.b.displacement(y)) * (1.0 + 1e-14);
    let bound = leading - a.slack - b.slack - rest - slack - displaced;
    // Not `max`: a NaN bounds nothing.
    if bound > 0.0 { bound } else { 0.0 }
}

/// Upper bound of the distance, from trial points within whose displacements points of the bodies lie.
pub(super) fn distance_upper(pair: &Pair<'_>, x: &Vector3<f64>, y: &Vector3<f64>) -> f64 {
    let displaced = pair.a.displacement(x) + pair.b.displacement(y);
    ((x - y).norm() + displaced) * (1.0 + 4.0 * f64::EPSILON)
}

/// Lower bound of the level distance d(A‖B), from a trial point and multipliers of both bodies; those of A are normalized
/// here to sum 1. Minus infinity where they bound nothing.
pub(super) fn level_lower(pair: &Pair<'_>, x: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) -> f64 {
    let of_a = of_a.map(|multiplier| if multiplier > 0.0 { multiplier } else { 0.0 });
    let total: f64 = of_a.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return f64::NEG_INFINITY;
    }
    let a = weigh(&pair.a, x, &of_a.map(|multiplier| multiplier / total));
    let b = weigh(&pair.b, x, of_b);
    let rest = ((a.gradient + b.gradient).norm() + a.gradient_error + b.gradient_error) * pair.b.reach(x);
    let slack = SLACK * (1.0 + a.magnitude + b.magnitude + rest);
    let steepest = a.gradient.norm() + a.gradient_error + b.gradient.norm() + b.gradient_error;
    let displaced = (pair.a.displacement(x) + pair.b.displacement(x)) * steepest;
    // Σ ν g = 1 - Σ ν (1 - g).
    let bound = 1.0 - a.slack - b.slack - rest - slack - displaced;
    if bound.is_nan() { f64::NEG_INFINITY } else { bound }
}
