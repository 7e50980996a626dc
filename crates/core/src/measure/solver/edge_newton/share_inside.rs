//! How far a point is to be moved towards the interior of a body so that all constraints hold.

use super::aggregate::Evaluated;
use crate::body::Body;
use crate::measure::frames::vector::{V3, apply_symmetric, dot};
use crate::measure::solver::tangent_newton::TAYLOR_ROUNDING;
use crate::polynomial::{NEAR_LEVEL, Simd};

/// The part of the way from the end of a step to the interior point along which all constraints are
/// proven to come to hold, by their jets where it starts; none if they seem far from that. The step
/// is given by normalized coordinates and in metres.
///
/// For a convex g with `g(x) <= v` and `g(c) <= v_0 < 1`, `g(x + s (c - x)) <= 1` from `s = (v - 1)
/// / (v - v_0)` on.
#[inline(always)]
pub(super) fn share_inside<S: Simd>(
    _: S,
    body: &Body,
    evaluated: &Evaluated,
    (delta, step): (V3<f64>, V3<f64>),
) -> Option<f64> {
    let (square, metres_square) = (dot::<S, f64>(delta, delta), dot::<S, f64>(step, step));
    let length = square.sqrt();
    let least = body.min_value();
    let mut share = 0.0_f64;
    for (jet, trust) in evaluated.jets.iter().zip(&body.trust().constraints) {
        let sloped = dot::<S, f64>(jet.gradient, delta);
        let third = &trust.third;
        let value = if third.ceiling == 0.0 || (jet.value - 1.0).abs() <= NEAR_LEVEL && length <= 0.5 * third.leeway {
            let bent = apply_symmetric::<S, f64>(&jet.hessian, delta);
            jet.value + sloped + 0.5 * dot::<S, f64>(delta, bent) + third.ceiling * square * length * (1.0 / 6.0)
        } else {
            jet.value + sloped + 0.5 * trust.curvature_ceiling * metres_square
        };
        let bound = value + 2.0 * trust.value_error + TAYLOR_ROUNDING * (jet.value.abs() + sloped.abs());
        if bound.is_nan() {
            return None;
        }
        if bound > 1.0 {
            share = share.max((bound - 1.0) / (bound - least));
        }
    }
    (share < 1e-3).then_some(share * (1.0 + 1e-9))
}
