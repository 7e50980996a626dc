//! A first look around all directions for the shortest way out of an overlap, by the outlines of the bodies. It proves
//! nothing: it only spares the proof from being about a way that is not the shortest.

use crate::measure::pair::Pair;
use crate::measure::vector::dot;
use crate::polynomial::{Simd, WithSimd};
use nalgebra::Vector3;

/// The look, as work for the widest arithmetic.
pub(super) struct Scout<'a> {
    pub(super) pair: &'a Pair<'a>,
}

/// Directions along each edge of the faces of a cube.
const STEPS: usize = 5;

impl WithSimd for Scout<'_> {
    type Output = (Vector3<f64>, f64);

    /// The best of the directions, a unit vector from B to A, and about how deep A is in B along it; query frame.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (Vector3<f64>, f64) {
        let (pair, a, b) = (self.pair, self.pair.a.body, self.pair.b.body);
        let (outline_a, outline_b) = (a.outline(), b.outline());
        let offset = pair.a_to_query(&a.normalization().center) - pair.b_to_query(&b.normalization().center);
        let mut best = (f64::INFINITY, Vector3::x());
        for face in 0..6 {
            for i in 0..STEPS {
                for j in 0..STEPS {
                    let across = |k: usize| (2 * k + 1) as f64 / STEPS as f64 - 1.0;
                    let mut n = Vector3::zeros();
                    n[face / 2] = if face % 2 == 0 { 1.0 } else { -1.0 };
                    (n[(face / 2 + 1) % 3], n[(face / 2 + 2) % 3]) = (across(i), across(j));
                    let own = pair.direction_to_b(&n);
                    let x = outline_a.point(outline_a.place(simd, [-n.x, -n.y, -n.z]));
                    let y = outline_b.point(outline_b.place(simd, own.into()));
                    let along = dot::<S, f64>(own.into(), y) - dot::<S, f64>(n.into(), x);
                    let depth = (along / pair.unit() - n.dot(&offset)) / n.norm();
                    if depth < best.0 {
                        best = (depth, n);
                    }
                }
            }
        }
        (best.1.normalize(), best.0)
    }
}
