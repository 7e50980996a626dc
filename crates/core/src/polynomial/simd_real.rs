//! What is computed with: one double, or several numbers side by side.

use super::jet::NumberJet;
use super::simd::Simd;
use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};

/// A constant in both precisions, as vectors of either load it without a conversion.
#[derive(Clone, Copy, Debug)]
pub struct Constant {
    pub(super) double: f64,
    pub(super) single: f32,
}

impl From<f64> for Constant {
    fn from(value: f64) -> Self {
        Self { double: value, single: value as f32 }
    }
}

/// Real numbers that are computed with: one double, or several doubles or singles side by side that
/// are independent of each other.
pub trait Number<S: Simd>:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Outcome of a comparison, lane by lane.
    type Mask: Copy;

    /// The distance from 1 to the next larger number.
    const EPSILON: f64;

    /// A number that is lost in any other, but has a square.
    const TINY: f64;

    /// The same value in every lane, rounded to the precision at hand.
    fn splat(simd: S, value: f64) -> Self;
    /// The same of a constant that was rounded before.
    fn constant(simd: S, value: &Constant) -> Self;
    /// `self b + c`, with one rounding where that is fast and two where not.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// One over each of two numbers, whose product is neither too large nor too small for a number.
    /// Several lanes wait for the unit that divides: one division does for both.
    #[inline(always)]
    fn reciprocals(simd: S, [a, b]: [Self; 2]) -> [Self; 2] {
        let inverse = Self::splat(simd, 1.0) / (a * b);
        [inverse * b, inverse * a]
    }
    /// Square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The smaller of two.
    fn min(self, other: Self) -> Self;
    /// The larger of two.
    fn max(self, other: Self) -> Self;
    /// `self <= other`; false where one is NaN.
    fn le(self, other: Self) -> Self::Mask;
    /// Both masks.
    fn and(simd: S, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Whether the mask is set in every lane.
    fn all(simd: S, mask: Self::Mask) -> bool;
    /// `self` where the mask is set, else `other`.
    fn select(self, mask: Self::Mask, other: Self) -> Self;
    /// Value, gradient and Hessian of a polynomial at points z, by the scheme that suits as many of
    /// them.
    fn jet(simd: S, schemes: &impl Schemes<S>, z: [Self; 3]) -> NumberJet<Self>;
    /// The rows of a table at whole-numbered places; the last one beyond its end, the first one for
    /// what is not a number.
    fn gather<const K: usize>(simd: S, table: &[[f64; K]], place: Self) -> [Self; K];
}

/// A polynomial with a scheme of evaluation for one point and another for several.
pub trait Schemes<S: Simd> {
    /// Value, gradient and Hessian at one point.
    fn one(&self, simd: S, z: [f64; 3]) -> NumberJet<f64>;
    /// The same at several points, a lane each.
    fn several<N: Number<S>>(&self, simd: S, z: [N; 3]) -> NumberJet<N>;
}

impl<S: Simd> Number<S> for f64 {
    type Mask = bool;

    const EPSILON: f64 = f64::EPSILON;
    const TINY: f64 = 1e-150;

    #[inline(always)]
    fn splat(_: S, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn constant(_: S, value: &Constant) -> Self {
        value.double
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        // Without the instruction it would be a call.
        if S::F64_LANES > 1 { f64::mul_add(self, b, c) } else { self * b + c }
    }
    #[inline(always)]
    fn reciprocals(_: S, [a, b]: [Self; 2]) -> [Self; 2] {
        // What comes after waits for a division, not for the unit.
        [1.0 / a, 1.0 / b]
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }
    #[inline(always)]
    fn and(_: S, a: bool, b: bool) -> bool {
        a & b
    }
    #[inline(always)]
    fn all(_: S, mask: bool) -> bool {
        mask
    }
    #[inline(always)]
    fn select(self, mask: bool, other: Self) -> Self {
        if mask { self } else { other }
    }
    #[inline(always)]
    fn jet(simd: S, schemes: &impl Schemes<S>, z: [Self; 3]) -> NumberJet<Self> {
        schemes.one(simd, z)
    }
    #[inline(always)]
    fn gather<const K: usize>(_: S, table: &[[f64; K]], place: Self) -> [Self; K] {
        table[(place as usize).min(table.len() - 1)]
    }
}
