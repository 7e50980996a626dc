//! How far a body reaches along a direction, with the point that does: one method after the other,
//! from the cheapest on.

use super::active_set::{SupportPoint, SupportProgram};
use super::lanes::{FarthestOne, FoundOne};
use crate::body::Body;
use crate::measure::frames::query_frame::Posed;
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::tangent_newton::{ALIGNED, TAYLOR_ROUNDING};
use crate::polynomial::{dispatch, gamma};
use nalgebra::Vector3;

/// Bracket of `max n·(x - c)` over the points x of a body, c the centre of its normalization.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Height {
    /// Attained by the point but for its rounding, metres.
    pub(in crate::measure) lower: f64,
    /// Metres.
    pub(in crate::measure) upper: f64,
    /// Point of the body that is farthest, body frame, metres.
    pub(in crate::measure) point: Vector3<f64>,
    /// The constraints active there; none of shapes with a closed form.
    pub(in crate::measure) active: ActiveSet,
    pub(in crate::measure) iterations: u32,
}

/// How accurate a height has to be.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Asked {
    /// Largest width of its bracket, metres.
    pub(in crate::measure) tolerance: f64,
    /// Largest angle between the direction and the normal at the point of a smooth surface,
    /// radians.
    pub(in crate::measure) angle: f64,
}

impl Asked {
    /// A bracket of this width, metres, at a point that gradients can be taken at.
    pub(in crate::measure) fn narrow(tolerance: f64) -> Self {
        Self { tolerance, angle: ALIGNED }
    }

    /// A bracket of this width, metres, wherever the point is.
    pub(in crate::measure) fn within(tolerance: f64) -> Self {
        Self { tolerance, angle: f64::INFINITY }
    }
}

/// The height of a body along a unit vector of its frame, as accurate as asked for if possible,
/// from a point of its frame known before, if there is one, with the constraints active there.
pub(in crate::measure) fn height(
    body: &Body,
    n: &Vector3<f64>,
    Asked { tolerance, angle }: Asked,
    known: Option<SupportPoint>,
    options: &Options<'_>,
) -> Height {
    if runs(Stage::ClosedForm)
        && let Some(form) = body.closed_form()
    {
        let [lower, upper] = form.heights(n);
        return Height { lower, upper, point: form.support_point(n), active: 0, iterations: 0 };
    }
    // Hints may be those of other bodies.
    let is_of_body = |active: ActiveSet| u32::from(active) >> body.constraints().len() == 0;
    let known = known.filter(|known| known.x.iter().all(|v| v.is_finite()) && is_of_body(known.active));
    let center = &body.normalization().center;
    let (mut known, mut spent) = (known, 0);
    if runs(Stage::SupportLanes) {
        // Of bodies with edges the constraint is followed that is known to be active alone.
        let is_single = |known: &SupportPoint| body.is_smooth() || known.active.count_ones() == 1;
        let is_edge = known.is_some_and(|known| known.active.count_ones() > 1);
        if !is_edge {
            let from = known.filter(is_single).map(|known| {
                let active = if body.is_smooth() { 0 } else { known.active.trailing_zeros() as usize };
                (known.x - center, active)
            });
            let limit = options.max_iterations();
            let (found, rounds) = dispatch(FarthestOne { body, n: *n, from, tolerance, angle, limit });
            let end = match found {
                Ok(found) => return followed(body, n, &found, rounds),
                Err(end) => end,
            };
            known = end.filter(|_| body.is_smooth()).map(|x| SupportPoint::at((center + x, 0))).or(known);
            spent = rounds;
        }
    }
    let ball = body.circumscribed();
    let unit = ball.radius.log2().round().exp2();
    let own = Posed::own(body, unit);
    let of_table = SupportPoint::at(body.farthest_in_table(n));
    let seen = |from: SupportPoint| SupportPoint { x: (from.x - ball.center) / unit, ..from };
    let (start, other) = (seen(known.unwrap_or(of_table)), known.map(|_| seen(of_table)));
    let program = SupportProgram { body: &own, direction: *n, start, other };
    let found = program.solve(tolerance / unit, |count| options.exhausted(spent + count));
    // From the centre of the ball, where the query frame is, to that of the normalization.
    let shift = n.dot(&(ball.center - center));
    let slack = gamma(8) * (ball.center.norm() + center.norm() + ball.radius);
    let (lower, point) = if found.lower > f64::NEG_INFINITY {
        (found.lower * unit + shift, found.point.x * unit + ball.center)
    } else {
        (n.dot(&(body.interior_point() - center)), *body.interior_point())
    };
    Height {
        lower: lower - slack,
        upper: found.upper * unit + shift + slack,
        point,
        active: found.point.active,
        iterations: spent + found.iterations,
    }
}

/// The height that one constraint proves, after so many evaluations.
fn followed(body: &Body, n: &Vector3<f64>, found: &FoundOne, iterations: u32) -> Height {
    let (along, trust) = (n.dot(&found.x), body.trust());
    let slack = trust.rounding * trust.reach + TAYLOR_ROUNDING * found.x.norm();
    Height {
        lower: along - slack,
        upper: along + found.deficit + slack,
        point: body.normalization().center + found.x,
        active: 1 << found.active,
        iterations,
    }
}
