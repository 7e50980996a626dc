//! How far a body reaches: support bounds proven by tangent planes, bounding box, circumscribed
//! ball, boundedness.

use super::placement::Placement;
use super::sphere::Sphere;
use super::{Aabb, Ball, BodyError, Constraint, largest, radial};
use crate::optimize::{MAX_ROWS, Program, Row, Rows, minimise};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use std::ops::ControlFlow;

/// Sum of duality gap and dual residual at which a support point is accurate enough, in the
/// normalized frame, where a body has size about 1; dimensionless.
///
/// It is reached in all but badly scaled bodies, and rounding allows no less. A larger value makes
/// bounding boxes too large by as much; a smaller one only costs iterations, as the best iterate is
/// kept. Pinned by `extents_of_exact_bodies_match_closed_forms`.
const SUPPORT_ACCURACY: f64 = 1e-14;

/// The program `max m·z` over the body in its normalized frame.
struct FarthestPoint<'a> {
    constraints: &'a [Constraint],
    direction: Vector3<f64>,
}

impl Program<3> for FarthestPoint<'_> {
    fn objective(&self, _: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        (-self.direction, Matrix3::zeros())
    }

    fn constraints(&self, z: &Vector3<f64>, rows: &mut Rows<3>) {
        for constraint in self.constraints {
            let jet = constraint.polynomial.evaluate(z);
            rows.push(Row { value: jet.value - 1.0, gradient: jet.gradient, hessian: jet.hessian, block: 0 });
        }
    }
}

/// A half-space `n·(x - anchor) <= reach + slope |x - point|` that contains the body, for a unit
/// normal n.
///
/// For any λ >= 0 and any point x0, convexity gives `n·(x - x0) <= Σ λ_i (1 - g_i(x0)) + |n - Σ λ_i
/// ∇g_i(x0)| |x - x0|` for every x of the body; the residual `slope` is tiny at the support point
/// but multiplies a distance not yet bounded.
pub(super) struct TangentBound {
    pub(super) point: Vector3<f64>,
    pub(super) reach: f64,
    pub(super) slope: f64,
}

/// What the support points of a body are computed from.
pub(super) struct SupportProblem<'a> {
    pub(super) constraints: &'a [Constraint],
    pub(super) placement: &'a Placement,
    /// Inverse of the placement's linear part, metres.
    pub(super) inverse: &'a Matrix3<f64>,
    /// A point inside, normalized frame.
    pub(super) interior_z: Vector3<f64>,
    /// Point from which heights are measured, body frame, metres.
    pub(super) anchor: &'a Vector3<f64>,
}

/// The point of the body farthest along a unit vector, up to the accuracy of its computation, and
/// the multipliers of the constraints; normalized frame. From a point inside.
pub(super) fn farthest_point(
    constraints: &[Constraint],
    direction: &Vector3<f64>,
    interior_z: &Vector3<f64>,
) -> (Vector3<f64>, [f64; MAX_ROWS]) {
    let program = FarthestPoint { constraints, direction: *direction };
    let reach = radial::radius(constraints, interior_z, &program.direction);
    let mut z = interior_z + program.direction * (0.9 * reach.min(1e6));
    // Past the accuracy of doubles the method drifts away again: the best iterate counts, not the
    // last.
    let mut best = (f64::INFINITY, z, [0.0; MAX_ROWS]);
    minimise(&program, &mut z, 1.0, |iterate| {
        let mut residual = program.direction;
        for (constraint, multiplier) in constraints.iter().zip(iterate.multipliers) {
            residual -= constraint.polynomial.evaluate(iterate.v).gradient * *multiplier;
        }
        let excess = iterate.gap + residual.norm();
        if excess < best.0 {
            best.2[..iterate.multipliers.len()].copy_from_slice(iterate.multipliers);
            (best.0, best.1) = (excess, *iterate.v);
        }
        let settled = best.0 < SUPPORT_ACCURACY || iterate.gap < 1e-3 * SUPPORT_ACCURACY;
        if settled { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    (best.1, best.2)
}

/// Support point of the body in the direction of the unit vector `n` of the body frame, with its
/// tangent bound.
pub(super) fn support(problem: &SupportProblem, n: &Vector3<f64>) -> TangentBound {
    let (point, multipliers) = support_point(problem, n);
    tangent(problem, n, &point, (0..).zip(multipliers).take(problem.constraints.len()))
}

/// Support point of the body in the direction of the unit vector `n` of the body frame, and the
/// multipliers of the constraints there, metres.
pub(super) fn support_point(problem: &SupportProblem, n: &Vector3<f64>) -> (Vector3<f64>, [f64; MAX_ROWS]) {
    let SupportProblem { constraints, placement, inverse, interior_z, .. } = *problem;
    let in_z = inverse.transpose() * n;
    let length = in_z.norm();
    let (z, multipliers) = farthest_point(constraints, &(in_z / length), &interior_z);
    (inverse * z + placement.origin(), multipliers.map(|multiplier| multiplier * length))
}

/// The half-space along the unit vector `n` of the body frame that a point, which may lie anywhere,
/// and multipliers of constraints, metres, prove; those that are no numbers of at least 0 prove
/// nothing.
pub(super) fn tangent(
    problem: &SupportProblem,
    n: &Vector3<f64>,
    point: &Vector3<f64>,
    multipliers: impl Iterator<Item = (usize, f64)>,
) -> TangentBound {
    let SupportProblem { constraints, placement, anchor, .. } = *problem;
    let mut reach = n.dot(&(point - anchor)) + 8.0 * f64::EPSILON * (point.norm() + anchor.norm());
    reach += 2.0 * placement.displacement(point);
    let mut residual = *n;
    let mut slope = 0.0;
    for (index, lambda) in multipliers {
        let Some(constraint) = constraints.get(index).filter(|_| lambda >= 0.0) else {
            return TangentBound { point: *point, reach: f64::INFINITY, slope: f64::INFINITY };
        };
        let sample = placement.sample(constraint, point);
        reach += lambda * (1.0 - sample.value() + sample.nearby_value_error());
        reach += 1e-14 * lambda * (1.0 + sample.value().abs());
        residual -= sample.gradient() * lambda;
        slope += lambda * (sample.gradient_error() + 1e-14 * sample.gradient().norm());
    }
    slope += residual.norm() + 8.0 * f64::EPSILON;
    TangentBound { point: *point, reach: reach + reach.abs() * 1e-14, slope: slope * (1.0 + 1e-14) }
}

/// Proven extent of a body in its own frame, metres.
pub(super) struct Extent {
    pub(super) bounding_box: Aabb,
    pub(super) circumscribed: Ball,
    /// Bounds of the normalized coordinates' magnitudes.
    pub(super) z_extent: Vector3<f64>,
}

impl Extent {
    /// Proves the body bounded and computes its bounding box and a circumscribed ball.
    ///
    /// With M(x) = max over the six axis directions of n·(x - a), each tangent bound reads `n·(x -
    /// a) <= reach + slope (√3 M + |point - a|)`, hence `M <= max(reach + slope |point - a|) / (1 -
    /// √3 max slope)` for every x of the body: a proof of boundedness that needs no bound
    /// beforehand, only positively spanning normals.
    pub(super) fn prove(
        constraints: &[Constraint],
        placement: &Placement,
        inverse: &Matrix3<f64>,
        interior: &Vector3<f64>,
    ) -> Result<Self, BodyError> {
        let interior_z = placement.linear() * (interior - placement.origin());
        let problem = SupportProblem { constraints, placement, inverse, interior_z, anchor: interior };
        let bound = |n: &Vector3<f64>| support(&problem, n);
        let axes: [Vector3<f64>; 6] = std::array::from_fn(|k| {
            let sign = if k < 3 { 1.0 } else { -1.0 };
            Vector3::from_fn(|i, _| if i == k % 3 { sign } else { 0.0 })
        });
        let bounds = axes.map(|axis| bound(&axis));
        let slope = largest(bounds.iter().map(|b| b.slope));
        let reach = largest(bounds.iter().map(|b| b.reach + b.slope * (b.point - interior).norm()));
        let reach_all = reach / (1.0 - 1.7321 * slope) * (1.0 + 1e-14);
        if !(slope < 0.5 && reach_all.is_finite()) {
            return Err(BodyError::Unbounded { residual: slope });
        }
        let radius = 1.7321 * reach_all;
        let close = |b: &TangentBound, radius: f64| b.reach + b.slope * (radius + (b.point - interior).norm());
        let reaches = bounds.each_ref().map(|b| (close(b, radius) * (1.0 + 1e-14)).next_up());
        let bounding_box = Aabb {
            min: Vector3::from_fn(|i, _| (interior[i] - reaches[i + 3]).next_down()),
            max: Vector3::from_fn(|i, _| (interior[i] + reaches[i]).next_up()),
        };

        // The normalized coordinates are heights along the rows of `linear`.
        let z_extent = Vector3::from_fn(|i, _| {
            let row = placement.linear().row(i).transpose();
            let n = row.normalize();
            let heights = [1.0, -1.0].map(|sign| {
                let side = n * sign;
                close(&bound(&side), radius) + side.dot(&(interior - placement.origin()))
            });
            let rounding = 16.0 * f64::EPSILON * (interior.norm() + placement.origin().norm() + radius);
            (largest(heights.into_iter()) + rounding) * row.norm() * (1.0 + 1e-13)
        });

        // Every point of the body is within `covering` of some direction of the sphere, as seen
        // from the centre.
        let center = (bounding_box.min + bounding_box.max) * 0.5;
        let half_diagonal = (bounding_box.max - bounding_box.min).norm() * 0.5;
        let sphere = Sphere::shared();
        let from_center =
            largest(sphere.vertices().iter().map(|n| close(&bound(n), radius) + n.dot(&(interior - center))));
        let slack = 16.0 * f64::EPSILON * (half_diagonal + center.norm());
        let radius = (from_center / sphere.covering_cosine()).min(half_diagonal) * (1.0 + 1e-14) + slack;
        Ok(Self { bounding_box, circumscribed: Ball { center, radius }, z_extent })
    }
}

/// The program `min s` subject to `g_i(z) <= s` in the normalized frame: the deepest point.
struct Deepest<'a> {
    constraints: &'a [Constraint],
}

impl Program<4> for Deepest<'_> {
    fn objective(&self, _: &SVector<f64, 4>) -> (SVector<f64, 4>, SMatrix<f64, 4, 4>) {
        (SVector::from([0.0, 0.0, 0.0, 1.0]), SMatrix::zeros())
    }

    fn constraints(&self, v: &SVector<f64, 4>, rows: &mut Rows<4>) {
        let z = v.xyz();
        for constraint in self.constraints {
            let jet = constraint.polynomial.evaluate(&z);
            rows.push(Row::new(jet.value - v[3], &jet.gradient, jet.hessian, 0, -1.0));
        }
    }
}

/// Minimiser of the largest constraint in the normalized frame and the minimum.
///
/// The minimum is attained for bodies; a program without one drives the value down or runs off,
/// which boundedness catches.
pub(super) fn deepest_point(constraints: &[Constraint]) -> (Vector3<f64>, f64) {
    let program = Deepest { constraints };
    let value = |z: &Vector3<f64>| largest(constraints.iter().map(|c| c.polynomial.evaluate(z).value));
    let start = value(&Vector3::zeros()) + 1.0;
    let mut v = SVector::from([0.0, 0.0, 0.0, start]);
    minimise(&program, &mut v, start.abs().max(1.0), |iterate| {
        if iterate.gap < 1e-14 * (1.0 + iterate.v[3].abs()) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    (v.xyz(), value(&v.xyz()))
}
