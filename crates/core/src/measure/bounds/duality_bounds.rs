//! Brackets proven for any trial point: lower bounds by convexity and Lagrange duality, upper
//! bounds by feasible points.
//!
//! For a linear functional r and multipliers λ >= 0 of the constraints of one body, every point x'
//! of the body satisfies
//!
//! ```text
//! r·(x' - x) >= -Σ λ_i (1 - g_i(x)) - |r + Σ λ_i ∇g_i(x)| · |x' - x|
//! ```
//!
//! by `1 >= g_i(x') >= g_i(x) + ∇g_i(x)·(x' - x)`. The last product is taken in the body's
//! normalized coordinates, component by component, where a body has size about 1 in every
//! direction: needles and plates then cost no digits. Hence, for a unit vector n, and with ν >= 0,
//! Σ ν = 1,
//!
//! ```text
//! D >= n·(x - y) + min over A of n·(x' - x) + min over B of -n·(y' - y)
//! d >= Σ ν_i g_i(x) + min over B of (Σ ν_i ∇g_i(x))·(x' - x)
//! ```
//!
//! Errors of values and gradients ([`crate::body::Sample`]) enter with the sign that loses. The
//! samples are exact for points displaced by at most δ_A, δ_B from the trial points
//! ([`crate::body::Placement::displacement`]): distances lose or gain the displacements, level
//! distances those times |Σ ν_i ∇g_i|. The few dozen roundings of the sums themselves are covered
//! by a relative slack on the sum of magnitudes.

use crate::body::MAX_CONSTRAINTS;
use crate::measure::frames::query_frame::{Pair, Posed};
use nalgebra::Vector3;

/// Rounding of a duality bound's own arithmetic, relative to the sum of magnitudes; dimensionless.
/// Fewer than 128 operations of half an epsilon each.
///
/// A smaller value could give a bound above what it bounds; a larger one keeps brackets wider than
/// asked for near the rounding floor. Pinned from below by
/// `slacks_cover_the_roundings_they_are_counted_for`, from above by
/// `bodies_on_lines_are_bracketed_to_the_last_bits`; the exact re-checks
/// (`tests/stability/recheck.rs`) compare both ends of brackets with rational arithmetic, but meet
/// a small part of the bound only.
pub(in crate::measure) const DUALITY_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Multipliers of the constraints of one body; zero where inactive.
pub(in crate::measure) type Multipliers = [f64; MAX_CONSTRAINTS];

/// Upper bound of `-min r·(x' - v)` over the points x' of a body, from multipliers of its
/// constraints; at least 0 in exact arithmetic for v inside.
pub(in crate::measure) fn descent(
    body: &Posed<'_>,
    v: &Vector3<f64>,
    r: &Vector3<f64>,
    multipliers: &Multipliers,
) -> f64 {
    let (mut residual, mut error) = body.functional(r);
    let (mut slack, mut magnitude) = (0.0, 0.0);
    error += residual.abs() * DUALITY_ROUNDING;
    for (i, &multiplier) in multipliers.iter().enumerate().take(body.len()) {
        if multiplier > 0.0 {
            let sample = body.sample(i, v);
            slack += multiplier * (1.0 - sample.value() + sample.nearby_value_error());
            magnitude += multiplier * (1.0 + sample.value().abs());
            residual += sample.z_gradient() * multiplier;
            error += (sample.z_gradient().abs() * DUALITY_ROUNDING).add_scalar(sample.z_gradient_error()) * multiplier;
        }
    }
    let rest = (residual.abs() + error).dot(&body.spans(v));
    slack + rest * (1.0 + DUALITY_ROUNDING) + DUALITY_ROUNDING * magnitude
}

/// What a bound of the distance or of a depth along a direction is made of; query frame.
#[derive(Clone, Copy)]
pub(in crate::measure) struct DualTrial<'a> {
    /// Trial point of A.
    pub(in crate::measure) x: &'a Vector3<f64>,
    /// Trial point of B.
    pub(in crate::measure) y: &'a Vector3<f64>,
    /// Direction from B to A, of any length above 0: the bounds normalize it.
    pub(in crate::measure) n: &'a Vector3<f64>,
    /// Multipliers of A.
    pub(in crate::measure) of_a: &'a Multipliers,
    /// Multipliers of B.
    pub(in crate::measure) of_b: &'a Multipliers,
}

/// Lower bound of the distance in query units, from multipliers for the unit direction. Never below
/// 0, which is always a bound.
#[inline]
pub(in crate::measure) fn distance_lower(pair: &Pair<'_>, trial: &DualTrial<'_>) -> f64 {
    let DualTrial { x, y, n, of_a, of_b } = *trial;
    let n = n / n.norm();
    let falls = descent(&pair.a, x, &n, of_a) + descent(&pair.b, y, &-n, of_b);
    let displaced = (pair.a.displacement(x) + pair.b.displacement(y)) * (1.0 + 1e-14);
    // n is a unit vector up to 4 roundings: a length of 1 + ε scales the bound by as much.
    let slack = DUALITY_ROUNDING * (x.norm() + y.norm() + falls.abs());
    let bound = n.dot(&(x - y)) - falls - displaced - slack;
    // Not `max`: a NaN bounds nothing.
    if bound > 0.0 { bound } else { 0.0 }
}

/// Upper bound of the distance, from trial points within whose displacements points of the bodies
/// lie.
pub(in crate::measure) fn distance_upper(pair: &Pair<'_>, x: &Vector3<f64>, y: &Vector3<f64>) -> f64 {
    let displaced = pair.a.displacement(x) + pair.b.displacement(y);
    ((x - y).norm() + displaced) * (1.0 + 4.0 * f64::EPSILON)
}

/// Lower bound of the level distance d(A‖B), from a trial point and multipliers of both bodies;
/// those of A are normalized here to sum 1. Minus infinity where they bound nothing.
pub(in crate::measure) fn level_lower(
    pair: &Pair<'_>,
    x: &Vector3<f64>,
    of_a: &Multipliers,
    of_b: &Multipliers,
) -> f64 {
    let of_a = of_a.map(|multiplier| if multiplier > 0.0 { multiplier } else { 0.0 });
    let total: f64 = of_a.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return f64::NEG_INFINITY;
    }
    // Σ ν g and its gradient with their errors; the weights sum to 1 up to the slack on the
    // magnitude.
    let (mut value, mut magnitude) = (0.0, 0.0);
    let (mut gradient, mut gradient_error) = (Vector3::zeros(), 0.0);
    for (i, multiplier) in of_a.iter().enumerate().take(pair.a.len()).filter(|(_, multiplier)| **multiplier > 0.0) {
        let weight = multiplier / total;
        let sample = pair.a.sample(i, x);
        value += weight * (sample.value() - sample.nearby_value_error());
        magnitude += weight * sample.value().abs();
        gradient += sample.gradient() * weight;
        gradient_error += weight * (sample.gradient_error() + DUALITY_ROUNDING * sample.gradient().norm());
    }
    let fall = descent(&pair.b, x, &gradient, of_b);
    let displaced = (pair.a.displacement(x) + pair.b.displacement(x)) * (gradient.norm() + gradient_error);
    let rest = gradient_error * pair.b.reach(x) + displaced;
    let bound = value - fall - rest * (1.0 + DUALITY_ROUNDING) - DUALITY_ROUNDING * (magnitude + fall.abs());
    if bound.is_nan() { f64::NEG_INFINITY } else { bound }
}
