//! Intervals of real numbers that contain the exact result of every operation.
//!
//! The bounds of a result are rounded to nearest and then moved one floating-point number outwards,
//! which covers that rounding, underflow included. A NaN, as from infinite bounds, spreads to
//! whatever is computed of it.

use std::ops::{Add, Mul, Neg, Sub};

/// All real numbers between two bounds; everything if one of them is NaN.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Interval {
    low: f64,
    high: f64,
}

impl Interval {
    pub(super) const ZERO: Self = Self { low: 0.0, high: 0.0 };

    /// This very number.
    pub(super) fn of(value: f64) -> Self {
        Self { low: value, high: value }
    }

    /// All numbers within a radius of this one.
    pub(super) fn around(value: f64, radius: f64) -> Self {
        Self { low: (value - radius).next_down(), high: (value + radius).next_up() }
    }

    /// The lower bound.
    pub(super) fn low(self) -> f64 {
        self.low
    }

    /// Upper bound of the magnitudes.
    pub(super) fn magnitude(self) -> f64 {
        if self.low.is_nan() || self.high.is_nan() { f64::NAN } else { self.low.abs().max(self.high.abs()) }
    }

    /// A number about halfway.
    pub(super) fn middle(self) -> f64 {
        0.5 * self.low + 0.5 * self.high
    }

    /// Whether 0 is surely outside.
    pub(super) fn is_nonzero(self) -> bool {
        !self.magnitude().is_nan() && (self.low > 0.0 || self.high < 0.0)
    }
}

impl Add for Interval {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        // Absent terms cost nothing.
        if self == Self::ZERO {
            return other;
        }
        if other == Self::ZERO {
            return self;
        }
        Self { low: (self.low + other.low).next_down(), high: (self.high + other.high).next_up() }
    }
}

impl Neg for Interval {
    type Output = Self;

    fn neg(self) -> Self {
        Self { low: -self.high, high: -self.low }
    }
}

impl Sub for Interval {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Interval {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        if (self == Self::ZERO && !other.magnitude().is_nan()) || (other == Self::ZERO && !self.magnitude().is_nan()) {
            return Self::ZERO;
        }
        let products = [self.low * other.low, self.low * other.high, self.high * other.low, self.high * other.high];
        // Not min and max alone: they pass over NaN.
        if products.iter().any(|product| product.is_nan()) {
            return Self::of(f64::NAN);
        }
        Self {
            low: products.into_iter().fold(f64::INFINITY, f64::min).next_down(),
            high: products.into_iter().fold(f64::NEG_INFINITY, f64::max).next_up(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use dashu_ratio::RBig;
    use sublevel_testkit::Seeded;

    fn exact(value: f64) -> RBig {
        RBig::try_from(value).unwrap()
    }

    fn holds(interval: Interval, value: &RBig) -> bool {
        exact(interval.low) <= *value && *value <= exact(interval.high)
    }

    #[test]
    fn exact_results_lie_inside_and_bounds_are_close() {
        let mut random = Seeded(1);
        for _ in 0..2000 {
            // Magnitudes from the smallest that there are to large ones.
            let mut draw = || random.signed() * 2_f64.powi((random.next() % 1200) as i32 - 1070);
            let [a, b, c] = [draw(), draw(), draw()];
            let computed = Interval::of(a) * Interval::of(b) - Interval::of(c) * (Interval::of(a) + Interval::of(b));
            let value = exact(a) * exact(b) - exact(c) * (exact(a) + exact(b));
            assert!(holds(computed, &value), "{a:e} {b:e} {c:e}: {computed:?}");
            let size = (a * b).abs() + (c * a).abs() + (c * b).abs();
            assert!(computed.high - computed.low <= 8.0 * f64::EPSILON * size + 1e-320, "{a:e} {b:e} {c:e}");
        }
    }

    #[test]
    fn what_is_not_a_number_stays_so() {
        let large = Interval::of(f64::MAX) * Interval::of(f64::MAX);
        let everything = large - large;
        assert!(everything.magnitude() == f64::INFINITY && !everything.is_nonzero());
        for unknown in [large * Interval { low: -1.0, high: 0.0 }, Interval::of(f64::NAN)] {
            assert!(unknown.magnitude().is_nan() && !unknown.is_nonzero());
            assert!((unknown * Interval::ZERO + Interval::of(1.0)).magnitude().is_nan());
        }
        assert!(Interval::of(-2.0).is_nonzero() && !(Interval::of(1.0) - Interval::of(1.0)).is_nonzero());
    }
}
