//! Functionals that are nonnegative on sums of squares, alone and times the slack of a constraint.
//!
//! A functional y on polynomials of v, held by its values on the monomials, is nonnegative on
//! squares when its moment matrix M(y) is positive semidefinite, and on squares times a polynomial
//! s when that of `y(s ·)` is. Either matrix is `spread(L y)` with a linear map L.
//!
//! In conic programs the rows of a matrix M are scaled, `D M D`, so that its pivots are about 1:
//! constraints hold to the solver's absolute tolerance, and pivots of 1e-3 would have a thousandth
//! of that accuracy.

use crate::conic_program::{ConicProgram, ConicSolution, Expression};
use crate::structure::Pattern;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::ops::Range;
use sublevel_core::polynomial::{degree_of, monomials, position};

/// Least square root of a pivot, relative to that of the diagonal, that a row is scaled by.
const LEAST_PIVOT: f64 = 1e-5;

/// A matrix linear in y that must be definite.
#[derive(Clone)]
pub(super) struct LocalizingMatrix {
    pattern: Pattern,
    /// L; the identity if there is none.
    map: Option<DMatrix<f64>>,
    /// Diagonal of D.
    scales: Vec<f64>,
}

/// One over the square roots of the pivots of a semidefinite matrix, or of its diagonal where it
/// has none or small ones: those of a singular matrix are rounding.
pub(super) fn scales(matrix: DMatrix<f64>) -> Vec<f64> {
    let diagonal = matrix.diagonal().map(f64::sqrt);
    let pivots = Cholesky::new(matrix).map_or(diagonal.clone(), |factor| factor.l_dirty().diagonal());
    pivots.iter().zip(&diagonal).map(|(&pivot, &entry)| 1.0 / pivot.max(LEAST_PIVOT * entry)).collect()
}

impl LocalizingMatrix {
    /// The matrix of that pattern itself.
    pub(super) fn of(pattern: Pattern) -> Self {
        Self { scales: vec![1.0; pattern.size], pattern, map: None }
    }

    /// The same matrix with its rows scaled by what it is at y.
    pub(super) fn scaled_at(self, y: &DVector<f64>) -> Self {
        Self { scales: scales(self.matrix(y)), ..self }
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
        Self { map: Some(map), ..Self::of(Pattern::of_monomials(half)) }
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

    /// Whether the matrix is positive definite at y.
    pub(super) fn is_definite(&self, y: &DVector<f64>) -> bool {
        Cholesky::new(self.matrix(y)).is_some()
    }

    /// `tr D M D`, as positions in y and factors.
    pub(super) fn trace(&self) -> impl Iterator<Item = (usize, f64)> {
        let of_row =
            move |i: usize| self.entry(i, i).into_iter().map(move |(k, factor)| (k, self.scales[i].powi(2) * factor));
        (0..self.size()).flat_map(of_row)
    }

    /// Keeps `D M D` semidefinite, y being the variables from `first` on; the rows of the
    /// constraint.
    pub(super) fn constrain(&self, program: &mut ConicProgram, first: usize) -> Range<usize> {
        program.semidefinite(self.size(), |i, j| {
            let scaled = |(k, factor)| (first + k, self.scales[i] * self.scales[j] * factor);
            Expression { terms: self.entry(i, j).into_iter().map(scaled).collect(), constant: 0.0 }
        })
    }

    /// `D (Z / factor + margin I) D`, Z the multiplier of that constraint.
    pub(super) fn gram(&self, solution: &ConicSolution, rows: Range<usize>, factor: f64, margin: f64) -> DMatrix<f64> {
        let multiplier = solution.matrix_multiplier(rows, self.size());
        DMatrix::from_fn(self.size(), self.size(), |i, j| {
            let margin = if i == j { margin } else { 0.0 };
            self.scales[i] * self.scales[j] * (multiplier[(i, j)] / factor + margin)
        })
    }

    /// The terms of an entry of M, as position in y and factor.
    fn entry(&self, i: usize, j: usize) -> Vec<(usize, f64)> {
        let key = self.pattern.key(i, j);
        match &self.map {
            Some(map) => map.row(key).iter().copied().enumerate().filter(|term| term.1 != 0.0).collect(),
            None => vec![(key, 1.0)],
        }
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
    fn entries_are_those_of_the_matrix() {
        let slack = DVector::from_iterator(10, monomials(2).iter().map(|e| 1.0 - value(*e, [0.2, 0.1, 0.3])));
        let y = DVector::from_fn(35, |i, _| (i as f64 * 0.37).cos());
        for cone in [LocalizingMatrix::squares(4), LocalizingMatrix::multiples(&slack, 4)] {
            let matrix = cone.matrix(&y);
            let size = cone.size();
            for (i, j) in (0..size).flat_map(|i| (0..size).map(move |j| (i, j))) {
                let entry: f64 = cone.entry(i, j).iter().map(|&(k, factor)| factor * y[k]).sum();
                assert!((entry - matrix[(i, j)]).abs() < 1e-14);
            }
        }
    }
}
