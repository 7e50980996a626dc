//! Rational numbers and vectors.

use dashu_ratio::RBig;
use nalgebra::Vector3;
use sublevel_testkit::reference::big::{Big, big, double};

/// A point or direction.
pub(crate) type Vector = [RBig; 3];

/// Bits of rational trial points. They only have to be near: what they prove is exact.
const BITS: usize = 128;

/// A double as it is.
pub(crate) fn exact(x: f64) -> RBig {
    RBig::try_from(x).expect("a finite number")
}

pub(crate) fn exacts(v: &Vector3<f64>) -> Vector {
    std::array::from_fn(|i| exact(v[i]))
}

/// A rational number near a reference's, with few digits.
pub(crate) fn near(x: &Big) -> RBig {
    RBig::try_from(x.clone().with_precision(BITS).value()).expect("a finite number")
}

pub(crate) fn nears(v: &[Big; 3]) -> Vector {
    std::array::from_fn(|i| near(&v[i]))
}

pub(crate) fn zero() -> Vector {
    [RBig::ZERO, RBig::ZERO, RBig::ZERO]
}

pub(crate) fn dot(a: &Vector, b: &Vector) -> RBig {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

pub(crate) fn add(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] + &b[i])
}

pub(crate) fn sub(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|i| &a[i] - &b[i])
}

pub(crate) fn scaled(a: &Vector, s: &RBig) -> Vector {
    std::array::from_fn(|i| &a[i] * s)
}

/// A number at most `|a|` and one at least that, next to it.
pub(crate) fn norm(a: &Vector) -> [RBig; 2] {
    root(&dot(a, a))
}

/// Bounds of the square root of a number that is not negative: guessed, then proven by squaring.
fn root(square: &RBig) -> [RBig; 2] {
    if square.is_zero() {
        return [RBig::ZERO, RBig::ZERO];
    }
    let guess = Big::from(square.numerator().clone()).with_precision(2 * BITS).value()
        / Big::from(square.denominator().clone()).with_precision(2 * BITS).value();
    let guess = guess.sqrt();
    let [below, above] = [-1.0, 1.0].map(|side| near(&(&guess * (big(1.0) + big(side * 2_f64.powi(-100))))));
    assert!(&below * &below <= *square && *square <= &above * &above, "the root of {square} is not near {guess}");
    [below, above]
}

#[test]
fn roots_are_bounded_closely() {
    for square in [2.0, 9.0, 1e-300, 1e300, 5e-324, 1.0 / 3.0] {
        let [below, above] = root(&exact(square));
        assert!(&below * &below < exact(square) && exact(square) < &above * &above);
        assert!(above - &below <= below * exact(2_f64.powi(-98)), "{square}");
    }
    assert_eq!(norm(&[exact(0.0), exact(-0.0), exact(0.0)]), [RBig::ZERO, RBig::ZERO]);
    assert_eq!(double(&big(2.0).sqrt()), 2_f64.sqrt());
}
