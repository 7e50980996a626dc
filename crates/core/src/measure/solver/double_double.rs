//! Double-double numbers: unevaluated sums of two doubles.
//!
//! Each operation is one of Joldes, Muller and Popescu, Tight and rigorous error bounds for basic
//! building blocks of double-word arithmetic, ACM Trans. Math. Software 44, 2017, with a relative
//! error of at most 10 u², u = 2⁻⁵³, short of under- and overflow: below [`UNIT`].

use nalgebra::Vector3;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Bound of the relative error of one operation, dimensionless, with a margin of 2⁷ that covers
/// sums of a hundred terms: an error of 2⁻¹⁰³ each.
///
/// A smaller value could make a refined bracket miss the truth; a larger one leaves brackets wider.
/// Pinned by `operations_undo_each_other` from below and by `impossible_accuracy_is_admitted` from
/// above.
pub(in crate::measure) const UNIT: f64 = 1.6e-29;

/// `hi + lo`, with `hi` the double nearest to the sum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::measure) struct Two {
    hi: f64,
    lo: f64,
}

/// A point or direction.
pub(in crate::measure) type Twos = [Two; 3];

impl Two {
    pub(in crate::measure) const ZERO: Self = Self { hi: 0.0, lo: 0.0 };

    /// The nearest double.
    pub(in crate::measure) fn double(self) -> f64 {
        self.hi
    }

    pub(in crate::measure) fn is_positive(self) -> bool {
        self.hi > 0.0
    }

    /// Square root of a number that is not negative.
    pub(in crate::measure) fn sqrt(self) -> Self {
        if !(self.hi > 0.0) {
            return Self::ZERO;
        }
        let root = self.hi.sqrt();
        let rest = (-root).mul_add(root, self.hi) + self.lo;
        fast(root, rest / (2.0 * root))
    }
}

impl From<f64> for Two {
    fn from(hi: f64) -> Self {
        Self { hi, lo: 0.0 }
    }
}

/// `a + b` without error.
fn sum(a: f64, b: f64) -> Two {
    let hi = a + b;
    let part = hi - a;
    Two { hi, lo: (a - (hi - part)) + (b - part) }
}

/// The same for `|a| >= |b|`.
fn fast(a: f64, b: f64) -> Two {
    let hi = a + b;
    Two { hi, lo: b - (hi - a) }
}

impl Add for Two {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let (s, t) = (sum(self.hi, other.hi), sum(self.lo, other.lo));
        let v = fast(s.hi, s.lo + t.hi);
        fast(v.hi, t.lo + v.lo)
    }
}

impl Neg for Two {
    type Output = Self;

    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl Sub for Two {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Two {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let hi = self.hi * other.hi;
        let rest = self.hi.mul_add(other.hi, -hi);
        fast(hi, rest + (self.hi.mul_add(other.lo, self.lo * other.hi) + self.lo * other.lo))
    }
}

impl Mul<f64> for Two {
    type Output = Self;

    fn mul(self, other: f64) -> Self {
        self * Self::from(other)
    }
}

impl Div for Two {
    type Output = Self;

    fn div(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        let rest = self - other * first;
        let second = rest.hi / other.hi;
        let last = (rest - other * second).hi / other.hi;
        fast(first, second) + Self::from(last)
    }
}

impl AddAssign for Two {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

pub(in crate::measure) fn twos(v: &Vector3<f64>) -> Twos {
    [v.x.into(), v.y.into(), v.z.into()]
}

/// The nearest doubles.
pub(in crate::measure) fn doubles(v: &Twos) -> Vector3<f64> {
    Vector3::new(v[0].hi, v[1].hi, v[2].hi)
}

pub(in crate::measure) fn dot(a: &Twos, b: &Twos) -> Two {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(in crate::measure) fn plus(a: &Twos, b: &Twos) -> Twos {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(in crate::measure) fn minus(a: &Twos, b: &Twos) -> Twos {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(in crate::measure) fn times(a: &Twos, s: Two) -> Twos {
    a.map(|value| value * s)
}

/// Rows times a vector.
pub(in crate::measure) fn apply(rows: &[Twos; 3], v: &Twos) -> Twos {
    [dot(&rows[0], v), dot(&rows[1], v), dot(&rows[2], v)]
}

pub(in crate::measure) fn transposed(rows: &[Twos; 3]) -> [Twos; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| rows[j][i]))
}

pub(in crate::measure) fn product(a: &[Twos; 3], b: &[Twos; 3]) -> [Twos; 3] {
    let columns = transposed(b);
    std::array::from_fn(|i| std::array::from_fn(|j| dot(&a[i], &columns[j])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn operations_undo_each_other() {
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let mut number = || Two::from(random.signed()) + Two::from(1e-17 * random.signed());
            let (a, b) = (number(), number());
            let close = |x: Two, y: Two, size: f64| (x - y).double().abs() <= UNIT * size;
            assert!(close((a + b) - b, a, 2.0), "seed {seed}");
            assert!(close((a * b) / b, a, 1.0), "seed {seed}");
            assert!(close((a * a).sqrt(), if a.is_positive() { a } else { -a }, 1.0), "seed {seed}");
            assert!(close((a + b) * (a - b), a * a - b * b, 2.0), "seed {seed}");
        }
    }
}
