//! Numbers that fill a vector of the processor: doubles, and singles for what needs no more than
//! that.

use super::jet::NumberJet;
use super::simd::Simd;
use super::simd_real::{Constant, Number, Schemes};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Several numbers side by side.
pub trait Vector<S: Simd>: Number<S> {
    /// How many.
    const COUNT: usize;

    /// The first values of a slice of at least [`Vector::COUNT`], rounded to the precision at hand.
    fn load(simd: S, values: &[f64]) -> Self;
    /// Writes the lanes to the front of a slice of at least [`Vector::COUNT`].
    fn store(self, target: &mut [f64]);
    /// The lanes where the mask is set, as bits.
    fn bits(simd: S, mask: Self::Mask) -> u32;
}

/// Most lanes of doubles of any processor served.
pub const MAX_LANES: usize = 8;

/// Most lanes of singles of any processor served.
pub const MAX_SINGLES: usize = 2 * MAX_LANES;

/// Values that vectors are loaded from or stored to, none of them across two lines of the cache. A
/// function with one among its variables aligns its stack, so that vectors that registers have no
/// room for do not straddle lines either.
#[derive(Clone, Copy, Debug, Default)]
#[repr(align(64))]
pub struct Aligned<T>(pub T);

/// As many doubles side by side as fit a vector.
#[derive(Clone, Copy, Debug)]
pub struct Lanes<S: Simd> {
    simd: S,
    values: S::f64s,
}

/// As many singles side by side as fit a vector: twice as many, for what more exact arithmetic
/// takes over from.
#[derive(Clone, Copy, Debug)]
pub struct Singles<S: Simd> {
    simd: S,
    values: S::f32s,
}

macro_rules! operators {
    ($lanes:ident: $($trait:ident $method:ident $operation:ident),*) => {$(
        impl<S: Simd> $trait for $lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { simd: self.simd, values: self.simd.$operation(self.values, other.values) }
            }
        }
    )*};
}
operators!(Lanes: Add add add_f64s, Sub sub sub_f64s, Mul mul mul_f64s, Div div div_f64s);
operators!(Singles: Add add add_f32s, Sub sub sub_f32s, Mul mul mul_f32s, Div div div_f32s);

macro_rules! functions {
    ($($method:ident $operation:ident $($other:ident)?),*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: Self)?) -> Self {
            Self { simd: self.simd, values: self.simd.$operation(self.values $(, $other.values)?) }
        }
    )*};
}

macro_rules! numbers {
    ($lanes:ident of $real:ident, $precision:ident, as $mask:ident, at most $most:ident, from $tiny:literal on: $splat:ident $neg:ident $fused:ident $le:ident $and:ident $select:ident,
     $($functions:tt)*) => {
        impl<S: Simd> Neg for $lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self { simd: self.simd, values: self.simd.$neg(self.values) }
            }
        }

        impl<S: Simd> Number<S> for $lanes<S> {
            type Mask = S::$mask;

            const EPSILON: f64 = $real::EPSILON as f64;
            const TINY: f64 = $tiny;

            #[inline(always)]
            fn splat(simd: S, value: f64) -> Self {
                Self { simd, values: simd.$splat(value as $real) }
            }
            #[inline(always)]
            fn constant(simd: S, value: &Constant) -> Self {
                Self { simd, values: simd.$splat(value.$precision) }
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                Self { simd: self.simd, values: self.simd.$fused(self.values, b.values, c.values) }
            }
            functions!($($functions)*);
            #[inline(always)]
            fn le(self, other: Self) -> S::$mask {
                self.simd.$le(self.values, other.values)
            }
            #[inline(always)]
            fn and(simd: S, a: S::$mask, b: S::$mask) -> S::$mask {
                simd.$and(a, b)
            }
            #[inline(always)]
            fn all(simd: S, mask: S::$mask) -> bool {
                Self::bits(simd, mask) == (1 << Self::COUNT) - 1
            }
            #[inline(always)]
            fn select(self, mask: S::$mask, other: Self) -> Self {
                Self { simd: self.simd, values: self.simd.$select(mask, self.values, other.values) }
            }
            #[inline(always)]
            fn jet(simd: S, schemes: &impl Schemes<S>, z: [Self; 3]) -> NumberJet<Self> {
                schemes.several(simd, z)
            }
            #[inline(always)]
            fn gather<const K: usize>(simd: S, table: &[[f64; K]], place: Self) -> [Self; K] {
                let mut places = Aligned([0.0; $most]);
                place.store(&mut places.0);
                let mut columns = Aligned([[0.0; $most]; K]);
                for (lane, place) in places.0[..Self::COUNT].iter().enumerate() {
                    let row = &table[(*place as usize).min(table.len() - 1)];
                    for (column, entry) in columns.0.iter_mut().zip(row) {
                        column[lane] = *entry;
                    }
                }
                let mut result = [place; K];
                for (result, column) in result.iter_mut().zip(&columns.0) {
                    *result = Self::load(simd, column);
                }
                result
            }
        }
    };
}
numbers!(Lanes of f64, double, as m64s, at most MAX_LANES, from 1e-150 on:
    splat_f64s neg_f64s mul_add_e_f64s less_than_or_equal_f64s and_m64s select_f64s,
    sqrt sqrt_f64s, abs abs_f64s, min min_f64s other, max max_f64s other);
numbers!(Singles of f32, single, as m32s, at most MAX_SINGLES, from 1e-18 on:
    splat_f32s neg_f32s mul_add_e_f32s less_than_or_equal_f32s and_m32s select_f32s,
    sqrt sqrt_f32s, abs abs_f32s, min min_f32s other, max max_f32s other);

/// A bit of its own for each lane: of those where a mask is set the sum is exact.
#[inline(always)]
fn powers<const LANES: usize>() -> [f64; LANES] {
    let mut powers = [0.0; LANES];
    for (lane, power) in powers.iter_mut().enumerate() {
        *power = f64::from(1_u32 << lane);
    }
    powers
}

impl<S: Simd> Vector<S> for Lanes<S> {
    const COUNT: usize = S::F64_LANES;

    #[inline(always)]
    fn load(simd: S, values: &[f64]) -> Self {
        Self { simd, values: S::as_simd_f64s(&values[..Self::COUNT]).0[0] }
    }
    #[inline(always)]
    fn store(self, target: &mut [f64]) {
        S::as_mut_simd_f64s(&mut target[..Self::COUNT]).0[0] = self.values;
    }
    #[inline(always)]
    fn bits(simd: S, mask: S::m64s) -> u32 {
        let powers = Self::load(simd, &powers::<MAX_LANES>());
        simd.reduce_sum_f64s(powers.select(mask, Self::splat(simd, 0.0)).values) as u32
    }
}

impl<S: Simd> Vector<S> for Singles<S> {
    const COUNT: usize = S::F32_LANES;

    #[inline(always)]
    fn load(simd: S, values: &[f64]) -> Self {
        let mut rounded = [0.0; MAX_SINGLES];
        for (rounded, value) in rounded.iter_mut().zip(&values[..Self::COUNT]) {
            *rounded = *value as f32;
        }
        Self { simd, values: S::as_simd_f32s(&rounded[..Self::COUNT]).0[0] }
    }
    #[inline(always)]
    fn store(self, target: &mut [f64]) {
        let mut values = [0.0; MAX_SINGLES];
        S::as_mut_simd_f32s(&mut values[..Self::COUNT]).0[0] = self.values;
        for (target, value) in target[..Self::COUNT].iter_mut().zip(values) {
            *target = f64::from(value);
        }
    }
    #[inline(always)]
    fn bits(simd: S, mask: S::m32s) -> u32 {
        let powers = Self::load(simd, &powers::<MAX_SINGLES>());
        simd.reduce_sum_f32s(powers.select(mask, Self::splat(simd, 0.0)).values) as u32
    }
}

#[cfg(test)]
mod tests {
    use crate::polynomial::simd::levels;
    use crate::polynomial::{Lanes, Simd, Singles, Twice, Vector, WithSimd};

    /// Numbers of singles that are the same as doubles.
    const VALUES: [f64; 64] = {
        let mut values = [0.0; 64];
        let mut i = 0;
        while i < 64 {
            values[i] = (i * 29 % 64) as f64 - 7.5;
            i += 1;
        }
        values
    };

    struct EveryKind;

    impl WithSimd for EveryKind {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) {
            lane_by_lane::<S, Lanes<S>>(simd);
            lane_by_lane::<S, Singles<S>>(simd);
            lane_by_lane::<S, Twice<Lanes<S>>>(simd);
            lane_by_lane::<S, Twice<Singles<S>>>(simd);
        }
    }

    fn stored<S: Simd, N: Vector<S>>(vector: N) -> Vec<f64> {
        let mut values = vec![0.0; N::COUNT];
        vector.store(&mut values);
        values
    }

    fn lane_by_lane<S: Simd, N: Vector<S>>(simd: S) {
        let (a, b) = (N::load(simd, &VALUES), N::load(simd, &VALUES[20..]));
        let each =
            |f: fn(f64, f64) -> f64| -> Vec<f64> { (0..N::COUNT).map(|i| f(VALUES[i], VALUES[20 + i])).collect() };
        assert_eq!(stored(a + b), each(|a, b| a + b));
        assert_eq!(stored(a - b), each(|a, b| a - b));
        assert_eq!(stored(a * b), each(|a, b| a * b));
        assert_eq!(stored(-a), each(|a, _| -a));
        assert_eq!(stored(a.mul_add(b, a)), each(|a, b| a * b + a));
        assert_eq!(stored(a.min(b)), each(f64::min));
        assert_eq!(stored(a.max(b)), each(f64::max));
        assert_eq!(stored(a.abs()), each(|a, _| a.abs()));
        assert_eq!(stored((a * a).sqrt()), each(|a, _| a.abs()));
        assert_eq!(stored((a * b) / b), each(|a, _| a));
        assert_eq!(stored(a.select(a.le(b), b)), each(f64::min));
        for bound in VALUES {
            let below = a.le(N::splat(simd, bound));
            let bits = (0..N::COUNT).filter(|&i| VALUES[i] <= bound).fold(0, |bits, i| bits | 1 << i);
            assert_eq!(N::bits(simd, below), bits);
            assert_eq!(N::all(simd, below), bits.count_ones() as usize == N::COUNT);
            let both = N::and(simd, below, b.le(a));
            let bits = (0..N::COUNT).filter(|&i| bits >> i & 1 == 1 && VALUES[20 + i] <= VALUES[i]);
            assert_eq!(N::bits(simd, both), bits.fold(0, |bits, i| bits | 1 << i));
        }
        let table: Vec<[f64; 2]> = (0..40).map(|i| [i as f64, 0.5 * i as f64]).collect();
        let row = |place: f64| (place as usize).min(39) as f64;
        let [first, second] = N::gather(simd, &table, a + N::splat(simd, 0.5));
        assert_eq!(stored(first), each(|a, _| a + 0.5).into_iter().map(row).collect::<Vec<_>>());
        assert_eq!(stored(second), stored(first * N::splat(simd, 0.5)));
        let [nothing, _] = N::gather(simd, &table, N::splat(simd, f64::NAN));
        assert_eq!(stored(nothing), vec![0.0; N::COUNT]);
    }

    #[test]
    fn every_kind_computes_lane_by_lane() {
        for arch in levels() {
            arch.dispatch(EveryKind);
        }
    }
}
