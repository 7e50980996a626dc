//! The arithmetic of the processor at hand, chosen when the program runs, and numbers that are one lane or several.
//!
//! Work for [`dispatch`] and [`dispatch_lanes`] is compiled up to three times by `pulp`: for any processor, for AVX2 with fused
//! multiply-add, and for AVX-512. Everything it calls has to be inlined into it to profit. Results differ between the versions
//! only within the rounding bounds, which count the roundings of the plain one.

use super::Polynomial;
use super::hessian_form::NumberJet;
use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::LazyLock;

pub use pulp::{Arch, Scalar, Simd, WithSimd};

/// Does work that is lanes throughout with the widest arithmetic of this processor.
#[inline]
pub fn dispatch_lanes<T: WithSimd>(work: T) -> T::Output {
    static WIDEST: LazyLock<Arch> = LazyLock::new(Arch::new);
    WIDEST.dispatch(work)
}

/// Does work on single numbers, or on lanes now and then, with AVX2 where the processor has it: among scalar instructions those
/// of AVX-512 cost more than they save, for while one of them is under way a port less takes all others. The searches of
/// penetration depths, lanes between scalar work, are 4 % faster so.
#[inline]
pub fn dispatch<T: WithSimd>(work: T) -> T::Output {
    static SUITED: LazyLock<Arch> = LazyLock::new(|| match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        widest @ Arch::V4(_) => pulp::x86::V3::try_new().map_or(widest, Arch::V3),
        widest => widest,
    });
    SUITED.dispatch(work)
}

/// Real numbers that are computed with: one double, or several side by side that know nothing of each other.
pub trait Number<S: Simd>:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Outcome of a comparison, lane by lane.
    type Mask: Copy;

    /// The same value in every lane.
    fn splat(simd: S, value: f64) -> Self;
    /// `self b + c`, with one rounding where that is fast and two where not.
    fn mul_add(self, b: Self, c: Self) -> Self;
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
    /// Whether the mask holds in every lane.
    fn all(simd: S, mask: Self::Mask) -> bool;
    /// `self` where the mask holds, else `other`.
    fn select(self, mask: Self::Mask, other: Self) -> Self;
    /// Value, gradient and Hessian of the polynomial at points z, by the scheme that suits as many of them.
    fn jet(simd: S, polynomial: &Polynomial, z: [Self; 3]) -> NumberJet<Self>;
    /// The rows of a table at whole-numbered places; the last one beyond its end, the first one for what is not a number.
    fn gather<const K: usize>(simd: S, table: &[[f64; K]], place: Self) -> [Self; K];
}

impl<S: Simd> Number<S> for f64 {
    type Mask = bool;

    #[inline(always)]
    fn splat(_: S, value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        // Without the instruction it would be a call.
        if S::F64_LANES > 1 { f64::mul_add(self, b, c) } else { self * b + c }
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
    fn jet(simd: S, polynomial: &Polynomial, z: [Self; 3]) -> NumberJet<Self> {
        polynomial.form.jet(simd, z)
    }
    #[inline(always)]
    fn gather<const K: usize>(_: S, table: &[[f64; K]], place: Self) -> [Self; K] {
        table[(place as usize).min(table.len() - 1)]
    }
}

/// Most lanes of any processor served.
pub const MAX_LANES: usize = 8;

/// As many doubles side by side as fit a vector.
#[derive(Clone, Copy, Debug)]
pub struct Lanes<S: Simd> {
    simd: S,
    values: S::f64s,
}

impl<S: Simd> Lanes<S> {
    /// How many.
    pub const COUNT: usize = S::F64_LANES;

    /// The first values of a slice of at least [`Lanes::COUNT`].
    #[inline(always)]
    pub fn load(simd: S, values: &[f64]) -> Self {
        Self { simd, values: S::as_simd_f64s(&values[..Self::COUNT]).0[0] }
    }

    /// Writes the lanes to the front of a slice of at least [`Lanes::COUNT`].
    #[inline(always)]
    pub fn store(self, target: &mut [f64]) {
        S::as_mut_simd_f64s(&mut target[..Self::COUNT]).0[0] = self.values;
    }

    /// The lanes where the mask holds, as bits.
    #[inline(always)]
    pub fn bits(simd: S, mask: S::m64s) -> u32 {
        let mut powers = [0.0; MAX_LANES];
        for (lane, power) in powers.iter_mut().enumerate() {
            *power = f64::from(1_u32 << lane);
        }
        simd.reduce_sum_f64s(Self::load(simd, &powers).select(mask, Self::splat(simd, 0.0)).values) as u32
    }
}

macro_rules! lane_operator {
    ($($trait:ident $method:ident $operation:ident),*) => {$(
        impl<S: Simd> $trait for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self { simd: self.simd, values: self.simd.$operation(self.values, other.values) }
            }
        }
    )*};
}
lane_operator!(Add add add_f64s, Sub sub sub_f64s, Mul mul mul_f64s, Div div div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { simd: self.simd, values: self.simd.neg_f64s(self.values) }
    }
}

macro_rules! lane_function {
    ($($method:ident $operation:ident $($other:ident)?),*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: Self)?) -> Self {
            Self { simd: self.simd, values: self.simd.$operation(self.values $(, $other.values)?) }
        }
    )*};
}

impl<S: Simd> Number<S> for Lanes<S> {
    type Mask = S::m64s;

    #[inline(always)]
    fn splat(simd: S, value: f64) -> Self {
        Self { simd, values: simd.splat_f64s(value) }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self { simd: self.simd, values: self.simd.mul_add_e_f64s(self.values, b.values, c.values) }
    }
    lane_function!(sqrt sqrt_f64s, abs abs_f64s, min min_f64s other, max max_f64s other);
    #[inline(always)]
    fn le(self, other: Self) -> S::m64s {
        self.simd.less_than_or_equal_f64s(self.values, other.values)
    }
    #[inline(always)]
    fn and(simd: S, a: S::m64s, b: S::m64s) -> S::m64s {
        simd.and_m64s(a, b)
    }
    #[inline(always)]
    fn all(simd: S, mask: S::m64s) -> bool {
        Self::bits(simd, mask) == (1 << Self::COUNT) - 1
    }
    #[inline(always)]
    fn select(self, mask: S::m64s, other: Self) -> Self {
        Self { simd: self.simd, values: self.simd.select_f64s(mask, self.values, other.values) }
    }
    #[inline(always)]
    fn jet(simd: S, polynomial: &Polynomial, z: [Self; 3]) -> NumberJet<Self> {
        polynomial.nested.jet(simd, z)
    }
    #[inline(always)]
    fn gather<const K: usize>(simd: S, table: &[[f64; K]], place: Self) -> [Self; K] {
        let mut places = [0.0; MAX_LANES];
        place.store(&mut places);
        let mut columns = [[0.0; MAX_LANES]; K];
        for (lane, place) in places[..Self::COUNT].iter().enumerate() {
            let row = &table[(*place as usize).min(table.len() - 1)];
            for (column, entry) in columns.iter_mut().zip(row) {
                column[lane] = *entry;
            }
        }
        let mut result = [place; K];
        for (result, column) in result.iter_mut().zip(&columns) {
            *result = Self::load(simd, column);
        }
        result
    }
}
