//! Functionals that are nonnegative on sums of squares, alone and times the slack of a constraint.
//!
//! A functional y on polynomials of v, held by its values on the monomials, is nonnegative on
//! squares when its moment matrix M(y) is positive semidefinite, and on squares times a polynomial
//! s when that of `y(s ·)` is. Either matrix is `spread(L y)` with a linear map L.

use crate::structure::Pattern;
use nalgebra::{Cholesky, DMatrix, DVector};
use sublevel_core::polynomial::{degree_of, monomials, position};

/// A matrix linear in y that must be definite.
#[derive(Clone)]
pub(super) struct LocalizingMatrix {
    pattern: Pattern,
    /// L; the identity if there is none.
    map: Option<DMatrix<f64>>,
}

impl LocalizingMatrix {
    /// The matrix of that pattern itself.
    pub(super) fn of(pattern: Pattern) -> Self {
        Self { pattern, map: None }
    }

    /// Moments of y up to even `degree`.
    pub(super) fn squares(degree: usize) -> Self {
        Self::of(Pattern::of_monomials(degree / 2))
    }

    /// Moments of `y(slack ·)`, the product with squares being of even `degree` at most;
    /// coefficients of the slack in the order of [`monomials`].
    pub(super) fn multiples(slack: &DVector<f64>, degree: usize) -> Self {
        let factor = (0..=degree).find(|&d| monomials(d).len() >= slack.len()).unwrap_or(degree);
        let half = (degree - factor) / 2;
        let (columns, rows) = (monomials(degree), monomials(2 * half));
        let mut map = DMatrix::zeros(rows.len(), columns.len());
        for (row, a) in rows.iter().enumerate() {
            for (&coefficient, b) in slack.iter().zip(&columns) {
                let product = std::array::from_fn(|k| a[k] + b[k]);
                debug_assert!(degree_of(product) <= degree);
                map[(row, position(product))] += coefficient;
            }
        }
        Self { pattern: Pattern::of_monomials(half), map: Some(map) }
    }

    /// Rows of the matrix.
    pub(super) fn size(&self) -> usize {
        self.pattern.size
    }

    /// The matrix at y.
    pub(super) fn matrix(&self, y: &DVector<f64>) -> DMatrix<f64> {
        match &self.map {
            Some(map) => self.pattern.spread(&(map * y)),
            None => self.pattern.spread(y),
        }
    }

    /// What a Gram matrix adds to the coefficients of the identity; adjoint of
    /// [`LocalizingMatrix::matrix`].
    pub(super) fn collapse(&self, gram: &DMatrix<f64>) -> DVector<f64> {
        let own = self.pattern.collapse(gram);
        self.map.as_ref().map_or_else(|| own.clone(), |map| map.tr_mul(&own))
    }

    /// The nearest Gram matrix to `gram` that gives these coefficients; for a cone without a map.
    pub(super) fn nearest(&self, gram: &DMatrix<f64>, coefficients: &DVector<f64>) -> DMatrix<f64> {
        self.pattern.nearest(gram, coefficients)
    }

    /// `log det` of the matrix; none unless it is definite.
    pub(super) fn log_det(&self, y: &DVector<f64>) -> Option<f64> {
        let factor = Cholesky::new(self.matrix(y))?;
        let value = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        value.is_finite().then_some(value)
    }

    /// Gradient of `log det`, and the Hessian of its negative.
    pub(super) fn derivatives(&self, y: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let gram = Cholesky::new(self.matrix(y))?.inverse();
        let own = self.pattern.congruence(&gram);
        let curvature = self.map.as_ref().map_or_else(|| own.clone(), |map| map.tr_mul(&(&own * map)));
        Some((self.collapse(&gram), curvature))
    }

    /// The inverse of the matrix at `to`, to first order from `at`: definite when the step is below
    /// 1 in the local norm.
    pub(super) fn predicted(&self, at: &DVector<f64>, to: &DVector<f64>) -> Option<DMatrix<f64>> {
        let gram = Cholesky::new(self.matrix(at))?.inverse();
        let predicted = &gram * 2.0 - &gram * self.matrix(to) * &gram;
        Some((&predicted + predicted.transpose()) * 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_core::polynomial::Exponents;

    fn value(e: Exponents, v: [f64; 3]) -> f64 {
        (0..3).map(|k| v[k].powi(i32::from(e[k]))).product()
    }

    /// For y the evaluation at v, the matrices are `m mᵀ` and `s(v) m mᵀ`.
    #[test]
    fn evaluations_give_matrices_of_rank_one() {
        let v = [0.3, -0.7, 0.5];
        let y = DVector::from_iterator(84, monomials(6).into_iter().map(|e| value(e, v)));
        let slack = DVector::from_iterator(10, (0..10).map(|i| (f64::from(i) * 1.3).sin()));
        let of_slack: f64 = slack.iter().zip(monomials(2)).map(|(c, e)| c * value(e, v)).sum();
        for (cone, factor, size) in
            [(LocalizingMatrix::squares(6), 1.0, 20), (LocalizingMatrix::multiples(&slack, 6), of_slack, 10)]
        {
            let matrix = cone.matrix(&y);
            assert_eq!(matrix.nrows(), size);
            let order = monomials(3);
            let exact = DMatrix::from_fn(size, size, |i, j| factor * value(order[i], v) * value(order[j], v));
            assert!((matrix - exact).amax() < 1e-15);
        }
    }

    #[test]
    fn derivatives_are_those_of_the_value() {
        let slack = DVector::from_iterator(10, monomials(2).iter().map(|e| 1.0 - value(*e, [0.2, 0.1, 0.3])));
        let points = (0..60).map(|i| [0.7, 0.9, 1.3].map(|s| (f64::from(i) * s).sin()));
        let y = points.fold(DVector::zeros(35), |sum: DVector<f64>, v| {
            sum + DVector::from_iterator(35, monomials(4).into_iter().map(|e| value(e, v)))
        });
        let direction = DVector::from_iterator(35, (0..35).map(|i| (f64::from(i) * 0.37).cos()));
        for cone in [LocalizingMatrix::squares(4), LocalizingMatrix::multiples(&slack, 4)] {
            let along = |t: f64| cone.log_det(&(&y + &direction * t)).unwrap();
            let (gradient, curvature) = cone.derivatives(&y).unwrap();
            let h = 1e-4;
            let first = (along(h) - along(-h)) / (2.0 * h);
            let second = -(along(h) - 2.0 * along(0.0) + along(-h)) / (h * h);
            assert!((first / gradient.dot(&direction) - 1.0).abs() < 1e-5);
            assert!((second / direction.dot(&(curvature * &direction)) - 1.0).abs() < 1e-4);
        }
    }
}
