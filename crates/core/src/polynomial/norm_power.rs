//! Powers of a squared norm in other coordinates, `c |A z + b|^2d`: what relaxes convexity.

use super::monomial::Exponents;
use super::rounding::gamma;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

/// Roundings on the way of any product into a coefficient of degree 8: 7 for the square of the
/// norm, 11 for each further factor, 1 for c; some to spare.
const POWER_ROUNDINGS: usize = 80;

/// The polynomial `c |linear z + offset|^degree`, expanded; every coefficient with a bound of its
/// error.
#[derive(Clone, Debug, PartialEq)]
pub struct NormPower {
    terms: Vec<(Exponents, f64, f64)>,
}

/// A polynomial beside the sum of the absolute values of all products that make its coefficients.
type Expansion = BTreeMap<Exponents, (f64, f64)>;

impl NormPower {
    /// Expands `factor |linear z + offset|^degree` for the numbers as they are given; `degree` is
    /// even, at most 8.
    pub fn new(factor: f64, linear: &Matrix3<f64>, offset: &Vector3<f64>, degree: usize) -> Self {
        let mut square = Expansion::new();
        for i in 0..3 {
            let axes = (0..3).map(|j| (std::array::from_fn(|k| u8::from(j == k)), linear[(i, j)]));
            let row = axes.chain([([0; 3], offset[i])]).map(|(e, value)| (e, (value, value.abs()))).collect();
            add_product(&mut square, &row, &row);
        }
        let mut power = Expansion::from([([0; 3], (factor, factor.abs()))]);
        for _ in 0..degree / 2 {
            let mut next = Expansion::new();
            add_product(&mut next, &power, &square);
            power = next;
        }
        let error =
            |magnitude: f64| gamma(POWER_ROUNDINGS) * magnitude * (1.0 + gamma(POWER_ROUNDINGS)) + f64::MIN_POSITIVE;
        Self { terms: power.into_iter().map(|(e, (value, magnitude))| (e, value, error(magnitude))).collect() }
    }

    /// Exponents, coefficient, and the bound of its error.
    pub fn terms(&self) -> &[(Exponents, f64, f64)] {
        &self.terms
    }
}

fn add_product(sum: &mut Expansion, a: &Expansion, b: &Expansion) {
    for (e, (value, magnitude)) in a {
        for (f, (other, size)) in b {
            let entry = sum.entry(std::array::from_fn(|i| e[i] + f[i])).or_default();
            entry.0 += value * other;
            entry.1 += magnitude * size;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::NormPower;
    use dashu_ratio::RBig;
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    fn exact(x: f64) -> RBig {
        RBig::try_from(x).unwrap()
    }

    #[test]
    fn values_agree_with_the_definition_within_the_bounds() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let scale = 10_f64.powf(3.0 * random.signed());
            let linear = Matrix3::from_fn(|_, _| scale * random.signed());
            let offset = Vector3::from_fn(|_, _| random.signed());
            let factor = 100.0 * random.signed().abs();
            for degree in [2, 4, 6, 8] {
                let power = NormPower::new(factor, &linear, &offset, degree);
                let z: [RBig; 3] = std::array::from_fn(|_| exact(random.signed()));
                let square = (0..3).fold(RBig::ZERO, |sum, i| {
                    let u = (0..3).fold(exact(offset[i]), |u, j| u + exact(linear[(i, j)]) * &z[j]);
                    sum + &u * &u
                });
                let truth = (0..degree / 2).fold(exact(factor), |product, _| product * &square);
                let (mut value, mut bound) = (RBig::ZERO, RBig::ZERO);
                for &(e, coefficient, error) in power.terms() {
                    let monomial = (0..3).fold(RBig::ONE, |product, i| (0..e[i]).fold(product, |p, _| p * &z[i]));
                    let size = if monomial < RBig::ZERO { -monomial.clone() } else { monomial.clone() };
                    value += exact(coefficient) * monomial;
                    bound += exact(error) * size;
                }
                let difference = if value > truth { value - truth } else { truth - value };
                assert!(difference <= bound, "seed {seed}, degree {degree}");
            }
        }
    }

    #[test]
    fn the_plain_norm_has_multinomial_coefficients() {
        let power = NormPower::new(10.0, &Matrix3::identity(), &Vector3::zeros(), 6);
        let find = |e| power.terms().iter().find(|term| term.0 == e).map_or(0.0, |term| term.1);
        assert_eq!([find([6, 0, 0]), find([4, 2, 0]), find([2, 2, 2]), find([5, 1, 0])], [10.0, 30.0, 60.0, 0.0]);
    }
}
