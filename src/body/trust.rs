//! Error bounds and curvature bounds that hold wherever the normalized coordinates of a point lie in a box a little larger
//! than the body's: made once, so that a query near the body pays for none of them.

use super::Constraint;
use crate::polynomial::gamma;
use nalgebra::{Matrix3, Vector3};

/// How much larger than the body the box is in each normalized coordinate.
const MARGIN: f64 = 1.125;

/// Bounds of a body's map and constraints within its box.
#[derive(Clone, Debug)]
pub struct Trust {
    /// Half the lengths of the box: the bounds hold where `|z_i| <= half_i`.
    pub half: [f64; 3],
    /// How far, in normalized coordinates, a point may leave the box while the curvature ceilings still hold.
    pub leeway: f64,
    /// Bound of the distance of points of the box from the normalization's centre, metres.
    pub reach: f64,
    /// Bound of the displacement of a point per distance from the centre by the roundings of `z = M (v - o)`, for an M of
    /// three roundings per entry; see [`super::Placement`].
    pub rounding: f64,
    /// Bound of `|M r| / |r|`, per metre.
    pub linear_norm: f64,
    /// Bound of `|M⁻¹ r| / |r|`, metres.
    pub inverse_norm: f64,
    /// Per constraint.
    pub constraints: Vec<ConstraintTrust>,
}

/// Bounds of one constraint `g(z)` within the box.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintTrust {
    /// Of the error of a computed value.
    pub value_error: f64,
    /// Of the error of each component of a computed gradient.
    pub gradient_error: f64,
    /// Smallest second derivative along any unit direction, anywhere in space: `g(z') >= g(z) + ∇g(z)·δ + ½ floor |δ|²`.
    pub curvature_floor: f64,
    /// Largest second derivative along any unit direction, within [`Trust::leeway`] of the box.
    pub curvature_ceiling: f64,
}

impl Trust {
    pub(super) fn new(
        constraints: &[Constraint],
        linear: &Matrix3<f64>,
        inverse: &Matrix3<f64>,
        extent: &Vector3<f64>,
    ) -> Self {
        let half = extent * MARGIN;
        let leeway = 0.125 * half.min();
        let rows = Vector3::from_fn(|i, _| linear.row(i).norm() * (1.0 + 1e-14));
        let columns = Vector3::from_fn(|i, _| inverse.column(i).norm() * (1.0 + 1e-14));
        // The computed inverse may be off by 1e-6 of its rows.
        let slack = 1.0 + 1e-5;
        let none = Vector3::zeros();
        let constraints = constraints.iter().map(|Constraint { polynomial, gram }| ConstraintTrust {
            value_error: polynomial.value_error(&half, &none, &none),
            gradient_error: polynomial.gradient_error(&half, &none),
            curvature_floor: gram.curvature_floor(polynomial),
            curvature_ceiling: polynomial.curvature_ceiling(&half.add_scalar(leeway)),
        });
        Self {
            half: half.into(),
            leeway,
            reach: columns.dot(&half) * slack,
            rounding: gamma(16) * rows.dot(&columns) * slack,
            linear_norm: linear.norm() * slack,
            inverse_norm: inverse.norm() * slack,
            constraints: constraints.collect(),
        }
    }
}
