//! The widest arithmetic of the processor at hand, chosen when the program runs, and numbers that are one lane or several.
//!
//! Work for [`dispatch`] is compiled three times by `pulp`: for any processor, for AVX2 with fused multiply-add, and for
//! AVX-512. Everything it calls has to be inlined into it to profit. Results differ between the versions only within the
//! rounding bounds, which count the roundings of the plain one.

use super::hessian_form::Row;
use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::sync::LazyLock;

pub use pulp::{Arch, Scalar, Simd, WithSimd};

/// Does the work with the widest arithmetic of this processor.
#[inline]
pub fn dispatch<T: WithSimd>(work: T) -> T::Output {
    static WIDEST: LazyLock<Arch> = LazyLock::new(Arch::new);
    WIDEST.dispatch(work)
}

/// Entries of a row of the table that carry something.
pub(super) const ENTRIES: usize = 10;

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
    /// `self` where the mask holds, else `other`.
    fn select(self, mask: Self::Mask, other: Self) -> Self;
    /// Sums over the rows k of a table of `table[k][i] powers[k]`, for each of the ten entries i.
    fn contract<const K: usize>(simd: S, table: &[Row; K], powers: &[Self; K]) -> [Self; ENTRIES];
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
    fn select(self, mask: bool, other: Self) -> Self {
        if mask { self } else { other }
    }
    /// The entries of a row lie side by side in vectors.
    #[inline(always)]
    fn contract<const K: usize>(simd: S, table: &[Row; K], powers: &[Self; K]) -> [Self; ENTRIES] {
        // Four sums in turn: a single one would wait for each addition before the next.
        let mut partial = [[simd.splat_f64s(0.0); ENTRIES]; 4];
        let vectors = ENTRIES.div_ceil(S::F64_LANES);
        for (rows, powers) in table.chunks(4).zip(powers.chunks(4)) {
            for ((row, &power), sums) in rows.iter().zip(powers).zip(&mut partial) {
                let power = simd.splat_f64s(power);
                for (sum, &entries) in sums.iter_mut().zip(&S::as_simd_f64s(&row.0).0[..vectors]) {
                    *sum = simd.mul_add_e_f64s(entries, power, *sum);
                }
            }
        }
        let mut stored = Row([0.0; 16]);
        for (i, target) in S::as_mut_simd_f64s(&mut stored.0).0[..vectors].iter_mut().enumerate() {
            let [a, b, c, d] = [partial[0][i], partial[1][i], partial[2][i], partial[3][i]];
            *target = simd.add_f64s(simd.add_f64s(a, b), simd.add_f64s(c, d));
        }
        let mut sums = [0.0; ENTRIES];
        sums.copy_from_slice(&stored.0[..ENTRIES]);
        sums
    }
    #[inline(always)]
    fn gather<const K: usize>(_: S, table: &[[f64; K]], place: Self) -> [Self; K] {
        table[(place as usize).min(table.len() - 1)]
    }
}

/// Most lanes of any processor served.
pub const MAX_LANES: usize = 16;

/// As many doubles side by side as fit two vectors: while one waits for a result the other computes.
#[derive(Clone, Copy, Debug)]
pub struct Lanes<S: Simd> {
    simd: S,
    values: [S::f64s; 2],
}

impl<S: Simd> Lanes<S> {
    /// How many.
    pub const COUNT: usize = 2 * S::F64_LANES;

    /// The first values of a slice of at least [`Lanes::COUNT`].
    #[inline(always)]
    pub fn load(simd: S, values: &[f64]) -> Self {
        let vectors = S::as_simd_f64s(&values[..Self::COUNT]).0;
        Self { simd, values: [vectors[0], vectors[1]] }
    }

    /// Writes the lanes to the front of a slice of at least [`Lanes::COUNT`].
    #[inline(always)]
    pub fn store(self, target: &mut [f64]) {
        let vectors = S::as_mut_simd_f64s(&mut target[..Self::COUNT]).0;
        (vectors[0], vectors[1]) = (self.values[0], self.values[1]);
    }

    /// The lanes where the mask holds, as bits.
    #[inline(always)]
    pub fn bits(simd: S, mask: [S::m64s; 2]) -> u32 {
        let mut powers = [0.0; MAX_LANES];
        for (lane, power) in powers.iter_mut().enumerate() {
            *power = f64::from(1_u32 << lane);
        }
        let [a, b] = Self::load(simd, &powers).select(mask, Self::splat(simd, 0.0)).values;
        simd.reduce_sum_f64s(simd.add_f64s(a, b)) as u32
    }
}

macro_rules! lane_operator {
    ($($trait:ident $method:ident $operation:ident),*) => {$(
        impl<S: Simd> $trait for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let (simd, [a, b], [c, d]) = (self.simd, self.values, other.values);
                Self { simd, values: [simd.$operation(a, c), simd.$operation(b, d)] }
            }
        }
    )*};
}
lane_operator!(Add add add_f64s, Sub sub sub_f64s, Mul mul mul_f64s, Div div div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let (simd, [a, b]) = (self.simd, self.values);
        Self { simd, values: [simd.neg_f64s(a), simd.neg_f64s(b)] }
    }
}

macro_rules! lane_function {
    ($($method:ident $operation:ident $($other:ident)?),*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: Self)?) -> Self {
            let (simd, [a, b]) = (self.simd, self.values);
            Self { simd, values: [simd.$operation(a $(, $other.values[0])?), simd.$operation(b $(, $other.values[1])?)] }
        }
    )*};
}

impl<S: Simd> Number<S> for Lanes<S> {
    type Mask = [S::m64s; 2];

    #[inline(always)]
    fn splat(simd: S, value: f64) -> Self {
        Self { simd, values: [simd.splat_f64s(value); 2] }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let (simd, [p, q], b, c) = (self.simd, self.values, b.values, c.values);
        Self { simd, values: [simd.mul_add_e_f64s(p, b[0], c[0]), simd.mul_add_e_f64s(q, b[1], c[1])] }
    }
    lane_function!(sqrt sqrt_f64s, abs abs_f64s, min min_f64s other, max max_f64s other);
    #[inline(always)]
    fn le(self, other: Self) -> [S::m64s; 2] {
        let (simd, [a, b], [c, d]) = (self.simd, self.values, other.values);
        [simd.less_than_or_equal_f64s(a, c), simd.less_than_or_equal_f64s(b, d)]
    }
    #[inline(always)]
    fn and(simd: S, [a, b]: [S::m64s; 2], [c, d]: [S::m64s; 2]) -> [S::m64s; 2] {
        [simd.and_m64s(a, c), simd.and_m64s(b, d)]
    }
    #[inline(always)]
    fn select(self, mask: [S::m64s; 2], other: Self) -> Self {
        let (simd, [a, b], [c, d]) = (self.simd, self.values, other.values);
        Self { simd, values: [simd.select_f64s(mask[0], a, c), simd.select_f64s(mask[1], b, d)] }
    }
    /// The lanes' own powers lie side by side in vectors.
    #[inline(always)]
    fn contract<const K: usize>(simd: S, table: &[Row; K], powers: &[Self; K]) -> [Self; ENTRIES] {
        // As many sums at a time as there are registers for.
        if S::F64_LANES == MAX_LANES / 2 {
            return sums(simd, table, powers, 0);
        }
        let first: [Self; ENTRIES / 2] = sums(simd, table, powers, 0);
        let last: [Self; ENTRIES / 2] = sums(simd, table, powers, ENTRIES / 2);
        let mut all = [first[0]; ENTRIES];
        all[..ENTRIES / 2].copy_from_slice(&first);
        all[ENTRIES / 2..].copy_from_slice(&last);
        all
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

/// Sums over the rows k of `table[k][from + i] powers[k]`, for some of the entries.
#[inline(always)]
fn sums<S: Simd, const K: usize, const COUNT: usize>(
    simd: S,
    table: &[Row; K],
    powers: &[Lanes<S>; K],
    from: usize,
) -> [Lanes<S>; COUNT] {
    let mut sums = [Lanes::splat(simd, 0.0); COUNT];
    let (rows, last_rows) = table.as_chunks::<5>();
    let (groups, last_powers) = powers.as_chunks::<5>();
    for (rows, powers) in rows.iter().zip(groups) {
        for (row, power) in rows.iter().zip(powers) {
            for (sum, &entry) in sums.iter_mut().zip(&row.0[from..]) {
                *sum = Lanes::splat(simd, entry).mul_add(*power, *sum);
            }
        }
    }
    for (row, power) in last_rows.iter().zip(last_powers) {
        for (sum, &entry) in sums.iter_mut().zip(&row.0[from..]) {
            *sum = Lanes::splat(simd, entry).mul_add(*power, *sum);
        }
    }
    sums
}
