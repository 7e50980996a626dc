//! Error bounds and curvature bounds that hold wherever the normalized coordinates of a point lie
//! in a ball a little larger than the body: made once, so that a query near the body computes none
//! of them.

use super::constraint::{Constraint, largest};
use super::normalization::Normalization;
use crate::polynomial::{ThirdCeiling, gamma};
use nalgebra::{Matrix3, Vector3};

/// Radius of the ball in which the bounds hold, relative to the farthest support point of the body;
/// dimensionless.
///
/// Trial points of a search lie a little outside of the body: a smaller value lets queries compute
/// the bounds again at many points, a larger one makes the bounds themselves larger. Pinned by
/// `the_ball_of_the_bounds_is_little_larger_than_the_body`.
const BALL_ENLARGEMENT: f64 = 1.0625;

/// Bounds of a body's map and constraints where `|z| <= radius`; lengths in metres, z unit-free.
#[derive(Clone, Debug)]
pub struct Trust {
    /// Radius of the ball of normalized coordinates where the bounds hold; checked at each point
    /// they are used at.
    pub radius: f64,
    /// Bound of the distance of points of the ball from the normalization's centre.
    pub reach: f64,
    /// Distance of the normalization's centre from the origin of the body frame.
    pub center: f64,
    /// Bound of the distance between points of the ball and of the body.
    pub span: f64,
    /// The same by normalized coordinates.
    pub normalized_span: f64,
    /// Bound of the displacement of a point per distance from the centre by the roundings of `z = M
    /// (v - o)`, for an M of three roundings per entry; see [`super::Placement`].
    pub rounding: f64,
    /// Condition number of M: bound of `|M r| / |r|` times that of its inverse.
    pub condition: f64,
    /// Bound of `|M⁻¹ r| / |r|`, metres.
    pub inverse_norm: f64,
    /// Bound of `|(M⁻¹ - computed inverse) r| / |r|`, metres.
    pub inverse_error: f64,
    /// Bound of `|M r| / |r|`, per metre.
    pub linear_norm: f64,
    /// How far a point of the ball may be moved where the curvature ceilings still hold.
    pub leeway: f64,
    /// Lower bound of the largest constraint anywhere in space: what the smallest value can be;
    /// minus infinity if the interior point proves none.
    pub least: f64,
    /// Per constraint.
    pub constraints: Vec<ConstraintTrust>,
}

/// Bounds of one constraint `g(z)` within the ball. What is said of z-derivatives is by unit
/// vectors of z, what is said of derivatives in metres by unit vectors of any frame that M maps to
/// z.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintTrust {
    /// Of the error of a computed value.
    pub value_error: f64,
    /// Of the error of a computed gradient, per metre.
    pub gradient_error: f64,
    /// Smallest second derivative anywhere in space, per square metre: with it
    /// `g(x') >= g(x) + ∇g(x)·δ + ½ floor |δ|²`. 0 if there is none.
    pub curvature_floor: f64,
    /// Largest second derivative in the ball, per square metre.
    pub curvature_ceiling: f64,
    /// Of the error of computed second derivatives by z.
    pub curvature_error: f64,
    /// Bound of the third derivatives by z, where the value is within
    /// [`crate::polynomial::NEAR_LEVEL`] of 1.
    pub third: ThirdCeiling,
}

/// Lengths of a body in its normalized frame.
pub(super) struct BodyLengths {
    /// Bounds of the coordinates' magnitudes.
    pub(super) z_extent: Vector3<f64>,
    /// Largest norm of its support points: hardly any point of it is farther from the origin.
    pub(super) reach: f64,
    /// Its interior point.
    pub(super) interior_z: Vector3<f64>,
}

impl Trust {
    /// Bounds for a body of these constraints, its normalization with the inverse of its linear
    /// part, and its lengths.
    pub(super) fn new(
        constraints: &[Constraint],
        Normalization { center, linear }: &Normalization,
        inverse: &Matrix3<f64>,
        &BodyLengths { z_extent: ref extent, reach, ref interior_z }: &BodyLengths,
    ) -> Self {
        let radius = reach * BALL_ENLARGEMENT;
        // Whether a point is in the ball is decided in floating point.
        let ball = radius * (1.0 + 1e-12);
        let rows = Vector3::from_fn(|i, _| linear.row(i).norm() * (1.0 + 1e-14));
        let columns = Vector3::from_fn(|i, _| inverse.column(i).norm() * (1.0 + 1e-14));
        // The computed inverse may be off by 1e-6 of its rows.
        let slack = 1.0 + 1e-5;
        let (norm, inverse_norm) = (linear.norm() * (1.0 + 1e-13), inverse.norm() * slack);
        let off = (linear * inverse - Matrix3::identity()).norm();
        let (none, at) = (Vector3::zeros(), Vector3::repeat(ball));
        // The smallest value is attained in the body, which the interior point's tangent plane
        // bounds from below.
        let span = ball + extent.norm() * (1.0 + 1e-13);
        let least = constraints.iter().map(|Constraint { polynomial, .. }| {
            let jet = polynomial.evaluate(interior_z);
            let slope = jet.gradient.norm() + 1.8 * polynomial.gradient_error(interior_z, &none);
            (jet.value - polynomial.value_error(interior_z, &none, &none) - slope * span * (1.0 + 1e-13)).next_down()
        });
        let least = largest(least);
        let constraints = constraints.iter().map(|Constraint { polynomial, gram }| ConstraintTrust {
            value_error: polynomial.value_error(&at, &none, &none),
            // 1.8 > √3: the bound is one of each component.
            gradient_error: 1.8 * polynomial.gradient_error(&at, &none) * norm,
            curvature_floor: gram.curvature_floor(polynomial) / (inverse_norm * inverse_norm) * (1.0 - 1e-13),
            // A little farther, for points that are moved from within the ball by a little.
            curvature_ceiling: polynomial.curvature_ceiling(1.25 * ball) * norm * norm * (1.0 + 1e-13),
            curvature_error: polynomial.curvature_error(ball),
            third: polynomial.third_ceiling(ball),
        });
        Self {
            radius,
            reach: inverse_norm * ball,
            center: center.norm(),
            span: inverse_norm * ball + columns.dot(extent) * slack,
            normalized_span: span,
            rounding: gamma(16) * rows.dot(&columns) * slack,
            condition: norm * inverse_norm,
            inverse_norm,
            // M⁻¹ = W - M⁻¹ (M W - I) for the computed inverse W.
            inverse_error: inverse_norm * (off + gamma(8) * norm * inverse_norm) * (1.0 + 1e-13),
            linear_norm: norm,
            least: if interior_z.norm() <= ball { least } else { f64::NEG_INFINITY },
            leeway: 0.1 * radius / norm * (1.0 - 1e-13),
            constraints: constraints.collect(),
        }
    }
}
