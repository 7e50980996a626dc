//! Bounds of the rounding error of an evaluation, by the polynomial of absolute coefficients.
//!
//! Every quantity [`super::Polynomial::evaluate`] returns is a sum of products of coefficients and
//! coordinates, and each product passes through at most `M` roundings: 1 for its table entry, at
//! most k - 3 for its monomial, 1 for the product of the two, K for the accumulation over the K
//! monomials, then 4 for a row of `F z̃`, 4 for the product with `z̃`, and 3 for the division by k
//! (k - 1), so `M = K + k + 10`; in the nested schemes for many points at most 2 for each power of
//! a coordinate and 3 for the three additions, which is less. Hence (Higham, Accuracy and Stability
//! of Numerical Algorithms, section 3.1) the error is at most `γ_M` times the same expression with
//! absolute values, which by Euler's identity is exactly `Σ |c_e| |z^e|`. With `r = max |z_i|` that
//! is at most `Q(r) = Σ_j C_j r^j`, `C_j` the sum of `|c_e|` over degree j: one Horner scheme,
//! valid everywhere. Derivatives of Q bound those of p in the same way.

use super::monomial::{Exponents, count, degree_of};
use nalgebra::Vector3;

/// `γ_m = m u / (1 - m u)`, u = 2⁻⁵³, rounded up: the relative error of m roundings in sequence.
pub const fn gamma(m: usize) -> f64 {
    let mu = m as f64 * (f64::EPSILON / 2.0);
    mu / (1.0 - mu) * (1.0 + 4.0 * f64::EPSILON)
}

/// Slack for products that underflow, in the unit of the polynomial's values: fewer than 2¹⁰
/// operations lose at most 2⁻¹⁰⁷⁵ each, and what follows multiplies that loss by at most
/// `56 (1 + max |c|) max(1, r)^k`.
///
/// A smaller value could leave a bound of exactly 0 where products underflowed; a larger one has no
/// effect up to 1e-30. No test pins it.
const UNDERFLOW: f64 = 1e-300;

/// How large a polynomial and its derivatives may be near a point, and how wrong when computed.
#[derive(Clone, Copy, Debug)]
pub struct Growth {
    /// Bound of the error of a computed value, and of `value + gradient·δ + ½ δᵀHδ` computed at one
    /// point as what Taylor's formula says, for δ that lead no farther than the bounds hold.
    pub value_error: f64,
    /// The same of a component of the gradient, and of `gradient + Hδ`.
    pub gradient_error: f64,
    /// Bound of the error of computed second derivatives along unit vectors.
    pub curvature_error: f64,
    /// Bound of the third derivatives along unit vectors.
    pub third: f64,
}

/// `Q(r) = Σ_j C_j r^j` with the rounding count of the evaluation it bounds.
#[derive(Clone, Debug)]
pub(super) struct AbsolutePolynomial {
    by_degree: [f64; 9],
    gamma: f64,
    sum: f64,
    degree: usize,
    /// Entry j: the norm of the derivative of order j + 3 of the terms of degree j + 3, over j!.
    third: [f64; 6],
}

fn factorial(n: usize) -> f64 {
    (1..=n).fold(1.0, |product, i| product * i as f64)
}

impl AbsolutePolynomial {
    pub(super) fn new(degree: usize, terms: &[(Exponents, f64)]) -> Self {
        let mut by_degree = [0.0; 9];
        let mut squares = [0.0; 9];
        for &(exponents, coefficient) in terms {
            let factorials: f64 = exponents.iter().map(|&e| factorial(usize::from(e))).product();
            by_degree[degree_of(exponents)] += coefficient.abs();
            squares[degree_of(exponents)] += coefficient * coefficient * factorials;
        }
        // Σ over e of degree j of j! e! c_e² is the squared Frobenius norm of the derivative of
        // order j.
        let third = std::array::from_fn(|j| (squares[j + 3] * factorial(j + 3)).sqrt() / factorial(j) * (1.0 + 1e-13));
        // The sums, Horner's scheme and the arithmetic of the bounds below round too: fewer than 2
        // * 165 + 64 steps, which only scale the bound by 1 + γ and are covered by counting 2
        // roundings more.
        let gamma = gamma(count(degree - 2) + degree + 12);
        let sum = by_degree.iter().sum();
        Self { by_degree, gamma, sum, degree, third }
    }

    /// `Q(r)`, `Q'(r)`, `Q''(r)`.
    fn jet(&self, r: f64) -> (f64, f64, f64) {
        let (mut q, mut dq, mut half_ddq) = (0.0, 0.0, 0.0);
        for &c in self.by_degree[..=self.degree].iter().rev() {
            half_ddq = half_ddq * r + dq;
            dq = dq * r + q;
            q = q * r + c;
        }
        (q, dq, 2.0 * half_ddq)
    }

    /// Bound of the values of p with absolute coefficients, and of the sum of its slopes, where
    /// `|z_i| <= r`.
    pub(super) fn magnitude(&self, r: f64) -> (f64, f64) {
        let (q, dq, _) = self.jet(r);
        (q * (1.0 + 1e-13) + self.underflow(r), dq * (1.0 + 1e-13) + self.underflow(r))
    }

    fn underflow(&self, r: f64) -> f64 {
        // Without a call to a general power.
        let square = r.max(1.0) * r.max(1.0);
        let power = (1..self.degree / 2).fold(square, |power, _| power * square);
        UNDERFLOW * (1.0 + self.sum) * power
    }

    pub(super) fn value_error(&self, z: &Vector3<f64>, gradient: &Vector3<f64>, dz: &Vector3<f64>) -> f64 {
        let (r, d) = (z.amax(), dz.amax());
        if d == 0.0 {
            let q = self.by_degree[..=self.degree].iter().rev().fold(0.0, |sum, &c| sum * r + c);
            // No displacement, but a gradient that is no number leaves nothing known.
            return (self.gamma * q + gradient.dot(dz)) * (1.0 + 1e-13) + self.underflow(r);
        }
        let (q, dq, ddq) = self.jet(r + d);
        // Taylor along dz: the exact first derivative differs from the computed one by at most γ
        // Q'.
        let first = gradient.abs().dot(dz) + 3.0 * d * self.gamma * dq;
        let second = 0.5 * ddq * d * d;
        (self.gamma * q + first + second) * (1.0 + 1e-13) + self.underflow(r)
    }

    /// Bound of second derivatives along unit vectors within `|z_i| <= r`: along the largest
    /// component Q'' bounds them, and no component of a unit vector exceeds 1.
    pub(super) fn curvature_ceiling(&self, r: f64) -> f64 {
        self.jet(r).2 * (1.0 + 1e-13) + self.underflow(r)
    }

    /// Bound of the error of second derivatives along unit vectors within `|z_i| <= r`, the
    /// Hessian's entries being sums of fewer roundings than values.
    pub(super) fn curvature_error(&self, r: f64) -> f64 {
        3.0 * self.gamma * self.curvature_ceiling(r)
    }

    /// Bound of the Frobenius norm of the third derivative within `|z_i| <= r`: none of its 27
    /// entries exceeds the third derivative of Q.
    pub(super) fn third_ceiling(&self, r: f64) -> f64 {
        let mut third = 0.0;
        for (k, &c) in self.by_degree.iter().enumerate().skip(3).rev() {
            third = third * r + c * (k * (k - 1) * (k - 2)) as f64;
        }
        5.2 * third * (1.0 + 1e-13) + self.underflow(r)
    }

    /// Bounds where `|z_i| <= coordinate`, `|z| <= length`.
    ///
    /// With both point and step in that range, the sums of absolute values of Taylor's formula are
    /// at most `Q` there. `Q` bounds its own derivatives: `r Q'(r) <= k Q(r)`. The third derivative
    /// of the terms of degree j is a tensor applied j - 3 times to z.
    #[inline(always)]
    pub(super) fn growth(&self, coordinate: f64, length: f64) -> Growth {
        let q = self.by_degree.iter().rev().fold(0.0, |sum, &c| sum * coordinate + c);
        let third = self.third.iter().rev().fold(0.0, |sum, &c| sum * length + c);
        // In this range underflow is out of the question for all terms but those below 1e-230.
        let tame = (1e-8..=1e8).contains(&coordinate);
        // Twice: for the roundings of the formula itself.
        let value_error = if tame { 2.0 * self.gamma * q * (1.0 + 1e-13) + 1e-230 } else { f64::NAN };
        let per_length = self.degree as f64 / coordinate;
        Growth {
            value_error,
            gradient_error: value_error * per_length,
            curvature_error: 3.0 * value_error * per_length * per_length,
            third: third * (1.0 + 1e-13),
        }
    }

    pub(super) fn gradient_error(&self, z: &Vector3<f64>, dz: &Vector3<f64>) -> f64 {
        let (r, d) = (z.amax(), dz.amax());
        let (_, dq, ddq) = self.jet(r + d);
        (self.gamma * dq + ddq * d) * (1.0 + 1e-13) + self.underflow(r)
    }
}

#[cfg(test)]
mod tests {
    use crate::polynomial::{Polynomial, monomials};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    #[test]
    fn growth_bounds_third_derivatives_and_extrapolations() {
        for seed in 0..80 {
            let mut random = Seeded(seed);
            let degree = [2, 4, 6, 8][(seed % 4) as usize];
            let terms = monomials(degree).into_iter().map(|e| (e, random.signed())).collect();
            let p = Polynomial::new(terms).unwrap();
            let mut tightest = f64::INFINITY;
            for _ in 0..200 {
                let z = Vector3::from_fn(|_, _| random.signed()) * 10_f64.powf(random.signed());
                let step = Vector3::from_fn(|_, _| random.signed()) * 0.01 * z.norm();
                let end = z + step;
                let growth = p.growth(z.amax() + step.amax(), z.norm() + step.norm());
                let (from, to) = (p.evaluate(&z), p.evaluate(&end));
                let length = step.norm();
                let slack = 2.0 * growth.value_error;
                // Hessians differ by at most the third derivative times the length; gradients and
                // values by its integrals.
                let change = (to.hessian - from.hessian).symmetric_eigenvalues().amax();
                assert!(change <= growth.third * length + 2.0 * growth.curvature_error, "seed {seed}");
                let bent = from.hessian * step;
                let gradient = (to.gradient - from.gradient - bent).norm();
                assert!(gradient <= 0.5 * growth.third * length.powi(2) + 4.0 * growth.gradient_error, "seed {seed}");
                let value = (to.value - from.value - from.gradient.dot(&step) - 0.5 * bent.dot(&step)).abs();
                assert!(value <= growth.third * length.powi(3) / 6.0 + slack, "seed {seed}: {value}");
                if degree > 2 {
                    tightest = tightest.min(growth.third * length / change);
                }
            }
            assert!(degree == 2 || tightest < 20.0, "seed {seed}: {tightest} times what is met");
        }
    }

    #[test]
    fn growth_bounds_the_rounding_of_small_steps() {
        for seed in 0..40 {
            let mut random = Seeded(100 + seed);
            let degree = [2, 4, 6, 8][(seed % 4) as usize];
            let terms = monomials(degree).into_iter().map(|e| (e, random.signed())).collect();
            let p = Polynomial::new(terms).unwrap();
            for _ in 0..200 {
                let z = Vector3::from_fn(|_, _| random.signed()) * 10_f64.powf(random.signed());
                // So short that the remainder is below rounding.
                let step = Vector3::from_fn(|_, _| random.signed()) * 1e-7 * z.norm();
                let end = z + step;
                let exact = end - z;
                let growth = p.growth(end.amax().max(z.amax()), end.norm().max(z.norm()));
                let (from, to) = (p.evaluate(&z), p.evaluate(&end));
                let value = from.value + from.gradient.dot(&exact) + 0.5 * exact.dot(&(from.hessian * exact));
                let remainder = growth.third * exact.norm().powi(3) / 6.0;
                assert!((value - to.value).abs() <= 2.0 * growth.value_error + remainder, "seed {seed}");
            }
        }
    }
}
