//! Proven lower bounds of polynomials of one or two points over basic sets.
//!
//! For u and v in the normalized coordinates of two sets, an identity
//!
//! ```text
//! f(u, v) - γ = Σ bᵀG b + Σ bᵀG b (1 - g),    G ⪰ 0,
//! ```
//!
//! with g <= 1 on a set, shows f >= γ there (Putinar; Lasserre, SIAM J. Optim. 11, 2001). A
//! solver's matrices are neither quite semidefinite nor is the identity quite true: each G is
//! raised by a multiple of I, in coordinates of about 1, until it is proven definite, what is left
//! over is computed in intervals, and its largest magnitude in a box around both sets is taken off:
//! the bound does not depend on where the matrices come from.

use super::Polynomial;
use super::interval::Interval;
use super::monomial::{Exponents, monomials};
use super::substitution::Substitution;
use super::verified_cholesky::is_positive_definite_above;
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Exponents of u and v.
pub type PairExponents = [u8; 6];

/// Which of the two points a polynomial is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Point {
    /// u.
    First,
    /// v.
    Second,
}

impl Point {
    /// Exponents of this point alone.
    pub fn exponents(self, [a, b, c]: Exponents) -> PairExponents {
        match self {
            Self::First => [a, b, c, 0, 0, 0],
            Self::Second => [0, 0, 0, a, b, c],
        }
    }
}

/// A polynomial of two points whose coefficients are enclosed.
#[derive(Clone, Debug, Default)]
pub struct PairPolynomial(BTreeMap<PairExponents, Interval>);

/// A Gram matrix on monomials of two points, times 1 or `1 - g`.
#[derive(Clone, Debug)]
pub struct WeightedSquares<'a> {
    /// The monomials.
    pub basis: Vec<PairExponents>,
    /// The matrix, of which the lower triangle is read.
    pub gram: DMatrix<f64>,
    /// g, and which point it is of; none for 1.
    pub constraint: Option<(&'a Polynomial, Point)>,
}

impl PairPolynomial {
    /// `|x(u) - y(v)|²` of two affine maps into one space.
    pub fn squared_distance(first: &Substitution, second: &Substitution) -> Self {
        let mut sum = Self::default();
        for axis in 0..3 {
            let ([a, a0], [b, b0]) = ([first.row(axis), first.row(axis)], [second.row(axis), second.row(axis)]);
            let mut line: Vec<(PairExponents, Interval)> = vec![([0; 6], a0.1 - b0.1)];
            for k in 0..3 {
                let unit: Exponents = std::array::from_fn(|i| u8::from(i == k));
                line.push((Point::First.exponents(unit), a.0[k]));
                line.push((Point::Second.exponents(unit), -b.0[k]));
            }
            for &(e, p) in &line {
                for &(f, q) in &line {
                    sum.add(std::array::from_fn(|i| e[i] + f[i]), p * q);
                }
            }
        }
        sum
    }

    /// `p(A v + b)` as a polynomial of one of the points, v.
    pub fn substituted(polynomial: &Polynomial, map: &Substitution, point: Point) -> Self {
        let coefficients = map.apply(polynomial);
        let order = monomials(polynomial.degree());
        Self(order.into_iter().zip(coefficients).map(|(e, coefficient)| (point.exponents(e), coefficient)).collect())
    }

    /// `Σ w_i f_i` with nonnegative weights of sum 1, which is nowhere above the largest f: all
    /// weights are those given but the largest, which is what the others leave of 1. None where
    /// one is negative or not a number, or where there are none.
    pub fn average(polynomials: &[Self], weights: &[f64]) -> Option<Self> {
        let largest = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b]))?;
        let others = || weights.iter().enumerate().filter(|&(i, _)| i != largest);
        if polynomials.len() != weights.len() || !others().all(|(_, &weight)| weight >= 0.0) {
            return None;
        }
        let rest = others().fold(Interval::of(1.0), |rest, (_, &weight)| rest - Interval::of(weight));
        if !(rest.low() >= 0.0) {
            return None;
        }
        let mut sum = Self::default();
        for (i, (polynomial, &weight)) in polynomials.iter().zip(weights).enumerate() {
            let weight = if i == largest { rest } else { Interval::of(weight) };
            for (&exponents, &coefficient) in &polynomial.0 {
                sum.add(exponents, weight * coefficient);
            }
        }
        Some(sum)
    }

    /// Its monomials with coefficients, rounded.
    pub fn terms(&self) -> impl Iterator<Item = (PairExponents, f64)> {
        self.0.iter().map(|(exponents, coefficient)| (*exponents, coefficient.middle()))
    }

    /// Its monomials but those whose coefficients may be zero, as far as they are known.
    pub fn support(&self) -> impl Iterator<Item = PairExponents> {
        let may_be_zero = |coefficient: &Interval| !coefficient.magnitude().is_nan() && !coefficient.is_nonzero();
        self.0.iter().filter(move |(_, coefficient)| !may_be_zero(coefficient)).map(|(exponents, _)| *exponents)
    }

    fn add(&mut self, exponents: PairExponents, value: Interval) {
        let sum = self.0.entry(exponents).or_insert(Interval::ZERO);
        *sum = *sum + value;
    }

    /// The powers of two nearest to bounds of coordinates: divided by these, coordinates are about
    /// 1 at most. Matrices are raised in these units, where a solver's errors are best alike too.
    pub fn scales(most: &[f64; 6]) -> [f64; 6] {
        most.map(|bound| if bound > 0.0 { 2_f64.powf(bound.log2().round().clamp(-20.0, 20.0)) } else { 1.0 })
    }

    /// A proven lower bound where every g is at most 1 and coordinates are at most `most` in
    /// magnitude; none where no matrix can be made definite, or numbers are not finite.
    pub fn lower_bound(&self, squares: &[WeightedSquares], most: &[f64; 6]) -> Option<f64> {
        let mut rest = self.clone();
        let scales = Self::scales(most);
        let scaled = |square: &WeightedSquares| {
            let factors: Vec<f64> = square.basis.iter().map(|e| power(&scales, e)).collect();
            let gram =
                DMatrix::from_fn(factors.len(), factors.len(), |i, j| square.gram[(i, j)] * factors[i] * factors[j]);
            (factors, gram)
        };
        let scaled: Vec<_> = squares.iter().map(scaled).collect();
        let entries = scaled.iter().flat_map(|(_, gram)| gram.iter());
        let size = entries.fold(f64::MIN_POSITIVE, |most: f64, entry| most.max(entry.abs()));
        for (WeightedSquares { basis, constraint, .. }, (factors, gram)) in squares.iter().zip(&scaled) {
            let gram = raised(gram, size)?;
            for (i, a) in basis.iter().enumerate() {
                for (j, b) in basis.iter().enumerate().take(i + 1) {
                    let factor = if i == j { 1.0 } else { 2.0 } / (factors[i] * factors[j]);
                    let entry = Interval::of(gram[(i, j)]) * Interval::of(factor);
                    let product: PairExponents = std::array::from_fn(|k| a[k] + b[k]);
                    rest.add(product, -entry);
                    let Some((g, point)) = constraint else { continue };
                    for &(exponents, coefficient) in g.terms() {
                        let factor = point.exponents(exponents);
                        let product = std::array::from_fn(|k| product[k] + factor[k]);
                        rest.add(product, entry * Interval::of(coefficient));
                    }
                }
            }
        }
        let mut bound = 0.0_f64;
        for (exponents, coefficient) in &rest.0 {
            let left = if *exponents == [0; 6] {
                -coefficient.low()
            } else {
                let largest = |k: usize| (0..exponents[k]).fold(1.0, |power: f64, _| (power * most[k]).next_up());
                (0..6).fold(coefficient.magnitude(), |size, k| (size * largest(k)).next_up())
            };
            bound = (bound - left).next_down();
        }
        bound.is_finite().then_some(bound)
    }
}

/// A product of powers of two.
fn power(scales: &[f64; 6], exponents: &PairExponents) -> f64 {
    scales.iter().zip(exponents).map(|(scale, &e)| scale.powi(i32::from(e))).product()
}

/// The matrix with as little added to its diagonal as proves it definite, up to `size` and more.
fn raised(gram: &DMatrix<f64>, size: f64) -> Option<DMatrix<f64>> {
    let rows = gram.nrows();
    let shares = std::iter::once(0.0).chain((0..30).map(|step| 1e-16 * 4_f64.powi(step)));
    let mut raised = shares.map(|share| gram + DMatrix::identity(rows, rows) * (share * size));
    raised.find(|raised| is_positive_definite_above(raised, 0.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    /// On the unit ball about 0 and that about (c, 0, 0) in coordinates of their own, with
    /// `f = |u - v - c|²`: level 0 is exact, with multiplier `c - 2` of both constraints and squares
    /// of the rest.
    #[test]
    fn two_balls_are_as_far_apart_as_they_are() {
        let one = Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)]).unwrap();
        let c = 5.0;
        let map = |x: f64| {
            Substitution::new(&Matrix3::identity(), &Vector3::zeros(), &Matrix3::identity(), &Vector3::new(x, 0.0, 0.0))
        };
        let f = PairPolynomial::squared_distance(&map(0.0), &map(c));
        // |u - v - c e|² - (c - 2)² - (c - 2)(1 - |u|²) - (c - 2)(1 - |v|²)
        let basis: Vec<PairExponents> =
            std::iter::once([0; 6]).chain((0..6).map(|k| std::array::from_fn(|i| u8::from(i == k)))).collect();
        let mut gram = DMatrix::zeros(7, 7);
        gram[(0, 0)] = c * c - (c - 2.0).powi(2) - 2.0 * (c - 2.0);
        for k in 1..7 {
            gram[(k, k)] = c - 1.0;
        }
        for k in 1..4 {
            gram[(k + 3, k)] = -1.0;
        }
        gram[(1, 0)] = -c;
        gram[(4, 0)] = c;
        let weight = |value: f64, point| WeightedSquares {
            basis: vec![[0; 6]],
            gram: DMatrix::repeat(1, 1, value),
            constraint: Some((&one, point)),
        };
        let squares = |value: f64| {
            let square = WeightedSquares { basis: basis.clone(), gram: gram.clone(), constraint: None };
            [square, weight(value, Point::First), weight(value, Point::Second)]
        };
        let bound = f.lower_bound(&squares(c - 2.0), &[1.0; 6]).unwrap();
        assert!(bound <= 9.0 && bound > 9.0 - 1e-12, "{bound}");
        // Wrong multipliers cost what they are wrong by, and prove nothing false.
        let wrong = f.lower_bound(&squares(c - 1.9), &[1.0; 6]).unwrap();
        assert!(wrong < 9.0 && wrong > 8.0, "{wrong}");
        let mut indefinite = squares(c - 2.0);
        indefinite[0].gram[(3, 3)] = -10.0;
        assert!(f.lower_bound(&indefinite, &[1.0; 6]).is_none_or(|bound| bound < 9.0));
        indefinite[0].gram[(3, 3)] = f64::NAN;
        assert_eq!(f.lower_bound(&indefinite, &[1.0; 6]), None);
    }

    /// |z|² for `z = v + (c, 0, 0)` on the unit ball is at least (c - 1)², with multiplier c - 1:
    /// `|v + c e|² - (c - 1)² = c |v + e|² + (c - 1)(1 - |v|²)`.
    #[test]
    fn one_point_of_a_ball_is_as_low_as_it_is() {
        let one = Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)]).unwrap();
        let c = 3.0;
        let identity = Matrix3::identity();
        let space = Substitution::to_space(&identity, &Vector3::zeros(), &identity, &Vector3::new(c, 0.0, 0.0));
        let zero = Vector3::zeros();
        let map = space.unwrap().then_normalized(&identity, &zero, &identity, &zero);
        let f = PairPolynomial::substituted(&one, &map, Point::First);
        let basis: Vec<PairExponents> = monomials(1).into_iter().map(|e| Point::First.exponents(e)).collect();
        let mut gram = DMatrix::identity(4, 4) * c;
        gram[(1, 0)] = c;
        gram[(0, 1)] = c;
        let constant = vec![[0; 6]];
        let multiplier = DMatrix::repeat(1, 1, c - 1.0);
        let squares = [
            WeightedSquares { basis, gram, constraint: None },
            WeightedSquares { basis: constant, gram: multiplier, constraint: Some((&one, Point::First)) },
        ];
        let most = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
        let bound = f.lower_bound(&squares, &most).unwrap();
        assert!(bound <= 4.0 && bound > 4.0 - 1e-12, "{bound}");
        // Without squares it is the bound of a box, |v + 3 e|² >= 9 - 6 - 3.
        let plain = f.lower_bound(&[], &most).unwrap();
        assert!(plain <= 0.0 && plain > -1e-12, "{plain}");
    }

    /// The same identity in other units proves the same, as well: a ball of radius 32 and of 1/32.
    #[test]
    fn bounds_do_not_depend_on_the_units_of_coordinates() {
        for radius in [32.0, 1.0 / 32.0] {
            let c = 3.0;
            let share = 1.0 / (radius * radius);
            let ball = Polynomial::new(vec![([2, 0, 0], share), ([0, 2, 0], share), ([0, 0, 2], share)]).unwrap();
            let linear = Matrix3::identity() / radius;
            let center = Vector3::new(-c * radius, 0.0, 0.0);
            let map = Substitution::new(&linear, &center, &Matrix3::identity(), &Vector3::zeros());
            let one = Polynomial::new(vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)]).unwrap();
            let f = PairPolynomial::substituted(&one, &map, Point::First);
            let basis: Vec<PairExponents> = monomials(1).into_iter().map(|e| Point::First.exponents(e)).collect();
            let mut gram = DMatrix::identity(4, 4) * (c * share);
            gram[(0, 0)] = c;
            gram[(1, 0)] = c / radius;
            gram[(0, 1)] = c / radius;
            // Short of definite by 1e-12 of its size, as of a solver.
            gram[(0, 0)] -= 1e-12;
            let squares = [
                WeightedSquares { basis, gram, constraint: None },
                WeightedSquares {
                    basis: vec![[0; 6]],
                    gram: DMatrix::repeat(1, 1, c - 1.0),
                    constraint: Some((&ball, Point::First)),
                },
            ];
            let bound = f.lower_bound(&squares, &[radius, radius, radius, 0.0, 0.0, 0.0]).unwrap();
            assert!(bound <= 4.0 && bound > 4.0 - 1e-10, "radius {radius}: {bound}");
        }
    }

    #[test]
    fn averages_are_nowhere_above_the_largest() {
        let constant = |value: f64| PairPolynomial(BTreeMap::from([([0; 6], Interval::of(value))]));
        let two = [constant(1.0), constant(5.0)];
        let bound = |weights: &[f64]| PairPolynomial::average(&two, weights)?.lower_bound(&[], &[1.0; 6]);
        let quarter = bound(&[0.25, 0.75]).unwrap();
        assert!(quarter <= 4.0 && quarter > 4.0 - 1e-14, "{quarter}");
        // Of weights whose sum is not 1 the largest is corrected.
        let corrected = bound(&[0.25, 3.0]).unwrap();
        assert!(corrected <= 4.0 && corrected > 4.0 - 1e-14, "{corrected}");
        let refused: [&[f64]; 5] = [&[-0.1, 1.1], &[2.0, 3.0], &[f64::NAN, 1.0], &[1.0], &[]];
        assert!(refused.iter().all(|weights| bound(weights).is_none()));
    }
}
