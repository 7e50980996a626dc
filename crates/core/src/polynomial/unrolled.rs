//! Two numbers in one.

use super::jet::NumberJet;
use super::lanes::Vector;
use super::simd::Simd;
use super::simd_real::{Constant, Number, Schemes};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Twice as many numbers: while one vector waits for its operands the other one is computed with.
#[derive(Clone, Copy, Debug)]
pub struct Twice<N>([N; 2]);

macro_rules! twice {
    ($($trait:ident $method:ident),*) => {$(
        impl<N: $trait<Output = N> + Copy> $trait for Twice<N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self([self.0[0].$method(other.0[0]), self.0[1].$method(other.0[1])])
            }
        }
    )*};
}
twice!(Add add, Sub sub, Mul mul, Div div);

impl<N: Neg<Output = N> + Copy> Neg for Twice<N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self([-self.0[0], -self.0[1]])
    }
}

impl<S: Simd, N: Vector<S>> Number<S> for Twice<N> {
    type Mask = [N::Mask; 2];
    const EPSILON: f64 = N::EPSILON;
    const TINY: f64 = N::TINY;

    #[inline(always)]
    fn splat(simd: S, value: f64) -> Self {
        Self([N::splat(simd, value); 2])
    }
    #[inline(always)]
    fn constant(simd: S, value: &Constant) -> Self {
        Self([N::constant(simd, value); 2])
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self([self.0[0].mul_add(b.0[0], c.0[0]), self.0[1].mul_add(b.0[1], c.0[1])])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self([self.0[0].sqrt(), self.0[1].sqrt()])
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self([self.0[0].abs(), self.0[1].abs()])
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self([self.0[0].min(other.0[0]), self.0[1].min(other.0[1])])
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self([self.0[0].max(other.0[0]), self.0[1].max(other.0[1])])
    }
    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        [self.0[0].le(other.0[0]), self.0[1].le(other.0[1])]
    }
    #[inline(always)]
    fn and(simd: S, a: Self::Mask, b: Self::Mask) -> Self::Mask {
        [N::and(simd, a[0], b[0]), N::and(simd, a[1], b[1])]
    }
    #[inline(always)]
    fn all(simd: S, mask: Self::Mask) -> bool {
        N::all(simd, mask[0]) && N::all(simd, mask[1])
    }
    #[inline(always)]
    fn select(self, mask: Self::Mask, other: Self) -> Self {
        Self([self.0[0].select(mask[0], other.0[0]), self.0[1].select(mask[1], other.0[1])])
    }
    #[inline(always)]
    fn jet(simd: S, schemes: &impl Schemes<S>, z: [Self; 3]) -> NumberJet<Self> {
        schemes.several(simd, z)
    }
    #[inline(always)]
    fn gather<const K: usize>(simd: S, table: &[[f64; K]], place: Self) -> [Self; K] {
        let (first, second) = (N::gather(simd, table, place.0[0]), N::gather(simd, table, place.0[1]));
        let mut result = [place; K];
        for (result, (first, second)) in result.iter_mut().zip(first.into_iter().zip(second)) {
            *result = Self([first, second]);
        }
        result
    }
}

impl<S: Simd, N: Vector<S>> Vector<S> for Twice<N> {
    const COUNT: usize = 2 * N::COUNT;

    #[inline(always)]
    fn load(simd: S, values: &[f64]) -> Self {
        Self([N::load(simd, values), N::load(simd, &values[N::COUNT..])])
    }
    #[inline(always)]
    fn store(self, target: &mut [f64]) {
        let (first, second) = target.split_at_mut(N::COUNT);
        self.0[0].store(first);
        self.0[1].store(second);
    }
    #[inline(always)]
    fn bits(simd: S, mask: Self::Mask) -> u32 {
        N::bits(simd, mask[0]) | N::bits(simd, mask[1]) << N::COUNT
    }
}
