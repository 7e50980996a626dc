//! Where the segment from a point inside a smooth body to one outside leaves it, about.

use crate::measure::frames::vector::{V3, add_scaled, dot, subtract};
use crate::measure::solver::tangent_newton::Side;
use crate::polynomial::{Simd, WithSimd};

/// Most evaluations; a guess needs few.
const MAX_STEPS: u32 = 12;

/// Value that is looked for: a point inside, but hardly, from where Newton's method can start.
const TARGET: f64 = 0.9;

/// How far from that the value may be.
const NEAR: f64 = 0.1;

/// A segment from inside a body to somewhere else; as vectorized work.
pub(super) struct Exit<'a> {
    pub(super) side: &'a Side<'a, f64>,
    pub(super) from: V3<f64>,
    pub(super) to: V3<f64>,
    /// Most evaluations.
    pub(super) most: u32,
}

impl WithSimd for Exit<'_> {
    /// A point of the segment inside the body and near its surface, and the evaluations that took;
    /// its end if that is inside.
    type Output = (V3<f64>, u32);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { side, from, to, most } = self;
        let most = most.min(MAX_STEPS);
        let way = subtract::<S, f64>(to, from);
        let (mut inside, mut outside, mut share) = (0.0, 1.0, 1.0);
        for step in 1..=most {
            let at = add_scaled::<S, f64>(from, share, way);
            let (jet, _) = side.jet(simd, at);
            if (jet.value - TARGET).abs() < NEAR || share == 1.0 && jet.value <= 1.0 {
                return (at, step);
            }
            if jet.value > TARGET {
                outside = share;
            } else {
                inside = share;
            }
            // Newton's step for the straightened constraint.
            let slope = dot::<S, f64>(side.gradient(simd, &jet), way);
            let next = share - (jet.value - TARGET) * (0.5 * jet.value + 0.5 * TARGET) / (TARGET * slope);
            share = if next > inside && next < outside { next } else { 0.5 * (inside + outside) };
        }
        (add_scaled::<S, f64>(from, inside, way), most)
    }
}
