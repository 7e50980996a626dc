//! The convex programs behind the measures, for the interior-point method.

use crate::body::{MAX_CONSTRAINTS, largest};
use crate::measure::bounds::duality_bounds::Multipliers;
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::optimize::{Program, Row, Rows};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// `min ½ |x - y|²` over x in A, y in B; variables (x, y).
pub(in crate::measure) struct Closest<'a>(pub(in crate::measure) &'a Pair<'a>);

/// The two points of the variables of [`Closest`].
pub(in crate::measure) fn points(v: &SVector<f64, 6>) -> (Vector3<f64>, Vector3<f64>) {
    (v.fixed_rows::<3>(0).into_owned(), v.fixed_rows::<3>(3).into_owned())
}

impl Program<6> for Closest<'_> {
    fn objective(&self, v: &SVector<f64, 6>) -> (SVector<f64, 6>, SMatrix<f64, 6, 6>) {
        let (x, y) = points(v);
        let difference = x - y;
        let mut gradient = SVector::<f64, 6>::zeros();
        gradient.fixed_rows_mut::<3>(0).copy_from(&difference);
        gradient.fixed_rows_mut::<3>(3).copy_from(&-difference);
        let mut hessian = SMatrix::<f64, 6, 6>::identity();
        hessian.fixed_view_mut::<3, 3>(0, 3).copy_from(&-Matrix3::identity());
        hessian.fixed_view_mut::<3, 3>(3, 0).copy_from(&-Matrix3::identity());
        (gradient, hessian)
    }

    fn constraints(&self, v: &SVector<f64, 6>, rows: &mut Rows<6>) {
        let (x, y) = points(v);
        for (body, point, block) in [(&self.0.a, x, 0), (&self.0.b, y, 3)] {
            for i in 0..body.len() {
                let jet = body.jet(i, &point);
                let mut gradient = SVector::<f64, 6>::zeros();
                gradient.fixed_rows_mut::<3>(block).copy_from(&jet.gradient);
                rows.push(Row { value: jet.value - 1.0, gradient, hessian: jet.hessian, block });
            }
        }
    }
}

/// A point strictly inside, most of the way from the inner point `center` along the unit vector u
/// to the boundary, where a body is curved; flat starts show a method nothing.
pub(in crate::measure) fn near_boundary(body: &Posed<'_>, center: &Vector3<f64>, u: &Vector3<f64>) -> Vector3<f64> {
    let outside = center + u * (2.0 * body.reach(center));
    let mut arm = (body.enter(&outside, &-u) - center) * 0.9;
    // Newton's method from far outside may have ended early.
    let value = |v: &Vector3<f64>| largest((0..body.len()).map(|i| body.value(i, v)));
    while !(value(&(center + arm)) < 1.0) && arm.norm_squared() > 0.0 {
        arm *= 0.7;
    }
    center + arm
}

/// `min s` over x and s subject to `g_i(x) <= s` for the constraints of A, and for those of B to
/// `g_j(x) <= s` (the point deepest in both) or `g_j(x) <= 1` (the level distance); variables (x, s
/// / scale).
pub(in crate::measure) struct Level<'a> {
    pub(in crate::measure) pair: &'a Pair<'a>,
    pub(in crate::measure) both: bool,
    /// Size of the values of A met on the way, so that far pairs are as well scaled as near ones.
    pub(in crate::measure) scale: f64,
}

impl Program<4> for Level<'_> {
    fn objective(&self, _: &SVector<f64, 4>) -> (SVector<f64, 4>, SMatrix<f64, 4, 4>) {
        (SVector::from([0.0, 0.0, 0.0, 1.0]), SMatrix::zeros())
    }

    fn constraints(&self, v: &SVector<f64, 4>, rows: &mut Rows<4>) {
        let x = v.xyz();
        let weight = 1.0 / self.scale;
        for i in 0..self.pair.a.len() {
            let jet = self.pair.a.jet(i, &x);
            rows.push(Row::new(jet.value * weight - v[3], &(jet.gradient * weight), jet.hessian * weight, 0, -1.0));
        }
        for i in 0..self.pair.b.len() {
            let jet = self.pair.b.jet(i, &x);
            rows.push(if self.both {
                Row::new(jet.value * weight - v[3], &(jet.gradient * weight), jet.hessian * weight, 0, -1.0)
            } else {
                Row::new(jet.value - 1.0, &jet.gradient, jet.hessian, 0, 0.0)
            });
        }
    }
}

/// Splits the multipliers of a program's rows into those of A and of B, times `factor`.
pub(in crate::measure) fn split(pair: &Pair<'_>, rows: &[f64], factor: f64) -> (Multipliers, Multipliers) {
    let (mut of_a, mut of_b) = ([0.0; MAX_CONSTRAINTS], [0.0; MAX_CONSTRAINTS]);
    let (first, second) = rows.split_at(pair.a.len());
    for (to, from) in of_a.iter_mut().zip(first).chain(of_b.iter_mut().zip(second)) {
        *to = from * factor;
    }
    (of_a, of_b)
}
