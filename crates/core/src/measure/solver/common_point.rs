//! Whether a point lies in both bodies of a pair.

use crate::measure::frames::vector::V3;
use crate::measure::solver::initial_guess::middle;
use crate::measure::solver::tangent_newton::Side;
use crate::polynomial::{Simd, WithSimd, dispatch};

/// A point from the centre of A's normalization on, in A's frame, metres.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct CommonPoint {
    pub(in crate::measure) v: V3<f64>,
    /// Whether it is proven to lie in both bodies; else it seems to, but for rounding.
    pub(in crate::measure) proven: bool,
}

impl CommonPoint {
    /// A point between x of A and y of B that lies in both, or seems to.
    #[inline(always)]
    pub(in crate::measure) fn between<S: Simd>(
        simd: S,
        sides: (&Side<'_, f64>, &Side<'_, f64>),
        x: V3<f64>,
        y: V3<f64>,
    ) -> Option<Self> {
        Self::at(sides, middle(simd, sides.0.body(), sides.1.body(), x, y))
    }

    /// The point, if it lies in both bodies or seems to.
    // Compiled once, and not with each method that asks.
    #[inline(never)]
    pub(in crate::measure) fn at((a, b): (&Side<'_, f64>, &Side<'_, f64>), v: V3<f64>) -> Option<Self> {
        dispatch(Containment { a, b, v })
    }
}

/// The question as vectorized work.
struct Containment<'a> {
    a: &'a Side<'a, f64>,
    b: &'a Side<'a, f64>,
    v: V3<f64>,
}

impl WithSimd for Containment<'_> {
    type Output = Option<CommonPoint>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<CommonPoint> {
        let v = self.v;
        let mut proven = true;
        for side in [self.a, self.b] {
            let [computed, surely] = side.highest(simd, v);
            if !(computed < 1.0) {
                return None;
            }
            proven &= surely <= 1.0;
        }
        Some(CommonPoint { v, proven })
    }
}
