//! Newton's method for the least value of a body's polynomial g over a set with a closed form:
//! every point it tries can prove on which side of contact the two are.
//!
//! A point y of the set with `g(y) <= 1` is a common one. Else, by convexity, the body lies in the
//! half-space `∇g·(x - y) <= 1 - g(y)`, and the set is at least
//!
//! ```text
//! (g(y) - 1 - ∇g·y - h(-∇g)) / |∇g|
//! ```
//!
//! from there, h its support function. From afar values decrease as powers of the distance, and
//! steps are those for the logarithm of g, whose Hessian is `H / g - ∇g ∇gᵀ / g²`; near the level
//! they are Newton's own.

use super::projectable::Projectable;
use crate::measure::frames::vector::{V3, add, dot, scaled, subtract};
use crate::measure::solver::tangent_newton::{PATIENCE, SEEK_ROUNDS, Side, TAYLOR_ROUNDING};
use crate::polynomial::{NumberJet, Simd, WithSimd};
use nalgebra::Vector3;

/// Length of a step, relative to the set, dimensionless, after which the least value is near enough
/// for Newton's method on the distance to start from.
///
/// A larger value starts it too far away, a smaller one takes evaluations without need. It changes
/// time only; no test pins it.
const SETTLED_MINIMUM: f64 = 1e-4;

/// Share of the logarithm's curvature that is taken off, dimensionless: of all of it steps may be
/// too long, of none they are a (d - 1)-th part of the way for a polynomial of degree d.
///
/// It changes time only; no test pins it.
const POWER: f64 = 0.75;

/// What has been proven.
#[derive(Clone, Copy, Debug)]
pub(super) enum Level {
    /// The point lies in both.
    Common(V3<f64>),
    /// They are at least this far apart, metres, along the unit vector from the set to the body.
    Apart { lower: f64, n: V3<f64>, y: V3<f64> },
    /// Neither.
    Open,
}

/// A body and a set; as vectorized work.
pub(super) struct LevelProblem<'a, P> {
    /// Point of the set to start from.
    pub(super) start: V3<f64>,
    pub(super) set: P,
    pub(super) side: &'a Side<'a, f64>,
    /// Bound of how far the set is from what it stands for, metres.
    pub(super) displacement: f64,
    /// Whether to go on, once they are proven apart, until the least value is found.
    pub(super) settle: bool,
    /// Most evaluations.
    pub(super) most: u32,
}

impl<P: Projectable> WithSimd for LevelProblem<'_, P> {
    /// What is proven, and how many evaluations it took.
    type Output = (Level, u32);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (Level, u32) {
        let Self { set, side, start: mut y, .. } = self;
        let (mut last, mut least, mut apart, mut rounds) = (y, f64::INFINITY, None, 0);
        // Bodies and sets that touch within rounding are left open by all of them.
        let most = self.most.min(SEEK_ROUNDS);
        for round in 1..=most {
            rounds = round;
            let (jet, inside) = side.jet(simd, y);
            let gradient = side.gradient(simd, &jet);
            let errors = if inside { Errors::near(side) } else { Errors::at(side, side.normalized(simd, y)) };
            if self.is_common(simd, &jet, gradient, &errors) {
                return (Level::Common(y), round);
            }
            let (lower, n) = self.separation(simd, &jet, gradient, (y, &errors));
            if lower > 0.0 {
                apart = Some(Level::Apart { lower, n, y });
                if !self.settle {
                    break;
                }
            }
            if !(jet.value <= least) {
                y = scaled::<S, f64>(add::<S, f64>(y, last), 0.5);
                continue;
            }
            (last, least) = (y, jet.value);
            let next = Descent { set, side }.next(simd, y, &jet, gradient, round);
            let step = subtract::<S, f64>(next, y);
            if dot::<S, f64>(step, step) <= SETTLED_MINIMUM * SETTLED_MINIMUM * set.reach() * set.reach() {
                break;
            }
            y = next;
        }
        (apart.unwrap_or(Level::Open), rounds)
    }
}

/// Newton's method for the least value of a body's polynomial over a set.
pub(super) struct Descent<'a, P> {
    pub(super) set: P,
    pub(super) side: &'a Side<'a, f64>,
}

impl<P: Projectable> Descent<'_, P> {
    /// The next point of the set after y with this jet and gradient, in this round.
    #[inline(always)]
    pub(super) fn next<S: Simd>(
        &self,
        simd: S,
        y: V3<f64>,
        jet: &NumberJet<f64>,
        gradient: V3<f64>,
        round: u32,
    ) -> V3<f64> {
        let hessian = self.side.hessian(simd, jet);
        let value = jet.value.max(1.0);
        // Steps that have not arrived by then are Newton's own wherever they are.
        let power = if round > PATIENCE { 0.0 } else { POWER / value * (1.0 - 1.0 / value) };
        let mut straight = hessian;
        for (entry, (i, j)) in straight.iter_mut().zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
            *entry -= power * gradient[i] * gradient[j];
        }
        let next = self.set.least(simd, y, gradient, &straight);
        if dot::<S, f64>(gradient, subtract::<S, f64>(next, y)) < 0.0 {
            next
        } else {
            self.set.least(simd, y, gradient, &hessian)
        }
    }
}

impl<P: Projectable> LevelProblem<'_, P> {
    /// Whether a point of the set with this jet, and the one it stands for, lie in the body.
    #[inline(always)]
    fn is_common<S: Simd>(&self, _: S, jet: &NumberJet<f64>, gradient: V3<f64>, errors: &Errors) -> bool {
        let constraint = &self.side.body().trust().constraints[self.side.active];
        let length = dot::<S, f64>(gradient, gradient).sqrt();
        let off = self.displacement + errors.displacement;
        let slope = length + errors.gradient + errors.turn * length + constraint.curvature_ceiling * off;
        jet.value + errors.value + slope * off * (1.0 + TAYLOR_ROUNDING) <= 1.0
    }

    /// Lower bound of the distance, metres, and its unit normal.
    #[inline(always)]
    fn separation<S: Simd>(
        &self,
        simd: S,
        jet: &NumberJet<f64>,
        gradient: V3<f64>,
        (y, errors): (V3<f64>, &Errors),
    ) -> (f64, V3<f64>) {
        let length = dot::<S, f64>(gradient, gradient).sqrt();
        let inverse = 1.0 / length;
        let n = scaled::<S, f64>(gradient, -inverse);
        // The gradient is off by so much over the way to any point of the body.
        let off = errors.value + (errors.gradient + errors.turn * length) * errors.span;
        let gap = self.set.separation(simd, n, (y, (1.0 - jet.value + off) * inverse));
        let size = y[0].abs() + y[1].abs() + y[2].abs() + self.set.reach() + jet.value * inverse;
        let rounding = TAYLOR_ROUNDING * size + errors.displacement + self.displacement;
        (gap - rounding, n)
    }
}

/// Bounds of the errors at a point; lengths in metres.
pub(super) struct Errors {
    /// Of the value.
    pub(super) value: f64,
    /// Of the gradient, per metre.
    pub(super) gradient: f64,
    /// Of the gradient, relative to it, by the rounding of the body's map.
    pub(super) turn: f64,
    /// Of the point, whose image is that of another as near as this.
    pub(super) displacement: f64,
    /// Of the distance from any point of the body.
    span: f64,
}

impl Errors {
    /// In the ball of the body's [`crate::body::Trust`].
    #[inline(always)]
    pub(super) fn near(side: &Side<'_, f64>) -> Self {
        let trust = side.body().trust();
        let constraint = &trust.constraints[side.active];
        let (value, gradient) = (constraint.value_error, constraint.gradient_error);
        Self { value, gradient, turn: side.turn(), displacement: side.displacement, span: trust.span }
    }

    /// Anywhere else, by the normalized coordinates of the point.
    #[cold]
    pub(super) fn at(side: &Side<'_, f64>, z: V3<f64>) -> Self {
        let (body, z) = (side.body(), Vector3::from(z));
        let (trust, polynomial) = (body.trust(), &body.constraints()[side.active].polynomial);
        let (none, farther) = (Vector3::zeros(), z.norm() / trust.radius * (1.0 + 1e-12));
        Self {
            value: polynomial.value_error(&z, &none, &none),
            // 1.8 > √3: the bound is one of each component.
            gradient: 1.8 * polynomial.gradient_error(&z, &none) * trust.linear_norm,
            turn: side.turn(),
            displacement: side.displacement * farther,
            span: trust.span * farther,
        }
    }

    /// By how much the gradient changes within a distance in metres of normalized coordinates, per
    /// metre.
    #[cold]
    pub(super) fn bend(&self, side: &Side<'_, f64>, z: V3<f64>, within: f64) -> f64 {
        let (body, z) = (side.body(), Vector3::from(z));
        let norm = body.trust().linear_norm;
        1.8 * body.constraints()[side.active].polynomial.gradient_error(&z, &Vector3::repeat(norm * within)) * norm
    }
}
