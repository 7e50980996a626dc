//! Cholesky's factorization in blocks.
//!
//! The systems of a path have up to a thousand unknowns, and nearly all of their time goes into
//! factors. By blocks it goes into matrix products, which the processor does many times as fast as
//! column by column (Golub and Van Loan, Matrix Computations, 4.2.9).

use nalgebra::{Cholesky, DMatrix};

/// Columns of a block: the products of wider ones are no faster, and the diagonal blocks of wider
/// ones are slower.
const BLOCK: usize = 48;

/// Lower factor of a symmetric positive definite matrix, of which the lower triangle is read; none
/// if it is not.
pub(super) fn cholesky(mut matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = matrix.nrows();
    for start in (0..n).step_by(BLOCK) {
        let width = BLOCK.min(n - start);
        let end = start + width;
        let diagonal = Cholesky::new(matrix.view((start, start), (width, width)).into_owned())?.unpack();
        matrix.view_mut((start, start), (width, width)).copy_from(&diagonal);
        // The panel X below solves X Lᵀ = A, column by column.
        let mut panel = matrix.view((end, start), (n - end, width)).into_owned();
        for j in 0..width {
            let (known, mut rest) = panel.columns_range_pair_mut(..j, j..);
            let mut column = rest.column_mut(0);
            for k in 0..j {
                column.axpy(-diagonal[(j, k)], &known.column(k), 1.0);
            }
            column /= diagonal[(j, j)];
        }
        matrix.view_mut((end, start), (n - end, width)).copy_from(&panel);
        for next in (end..n).step_by(BLOCK) {
            let columns = BLOCK.min(n - next);
            let below = panel.rows_range(next - end..);
            let beside = panel.rows(next - end, columns).transpose();
            matrix.view_mut((next, next), (n - next, columns)).gemm(-1.0, &below, &beside, 1.0);
        }
    }
    matrix.fill_upper_triangle(0.0, 1);
    matrix.iter().all(|v| v.is_finite()).then_some(matrix)
}

/// Lower factor of a matrix that is positive definite up to rounding: its diagonal grows until it
/// is. A slightly wrong curvature changes the path of Newton's steps, not where they end.
pub(super) fn regularised_factor(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    [0.0, 1e-14, 1e-12, 1e-10, 1e-8].into_iter().find_map(|share| {
        let mut matrix = matrix.clone();
        for i in 0..matrix.nrows() {
            matrix[(i, i)] *= 1.0 + share;
        }
        cholesky(matrix)
    })
}

/// Solves `L X = B` for a lower factor L.
pub(super) fn solve_lower(factor: &DMatrix<f64>, mut right: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = factor.nrows();
    for start in (0..n).step_by(BLOCK) {
        let width = BLOCK.min(n - start);
        let end = start + width;
        let known = factor.view((start, start), (width, width)).solve_lower_triangular(&right.rows(start, width))?;
        right.rows_mut(start, width).copy_from(&known);
        right.rows_mut(end, n - end).gemm(-1.0, &factor.view((end, start), (n - end, width)), &known, 1.0);
    }
    Some(right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn factors_and_solutions_are_those_of_nalgebra() {
        for (seed, n) in [1, 2, 47, 48, 49, 96, 131, 200].into_iter().enumerate() {
            let mut random = Seeded(seed as u64);
            let root = DMatrix::from_fn(n, n + 3, |_, _| random.signed());
            let matrix = &root * root.transpose();
            let factor = cholesky(matrix.clone()).unwrap();
            let scale = matrix.amax();
            assert!((&factor * factor.transpose() - &matrix).amax() < 1e-12 * scale * n as f64, "{n} rows");
            assert!((&factor - Cholesky::new(matrix).unwrap().unpack()).amax() < 1e-8 * scale, "{n} rows");
            let right = DMatrix::from_fn(n, 5, |_, _| random.signed());
            let solution = solve_lower(&factor, right.clone()).unwrap();
            assert!((&factor * &solution - right).amax() < 1e-9 * (1.0 + solution.amax() * scale.sqrt()), "{n} rows");
        }
    }

    #[test]
    fn indefinite_and_spoilt_matrices_have_no_factor() {
        for n in [3, 60, 120] {
            let mut matrix = DMatrix::identity(n, n);
            matrix[(n - 1, n - 1)] = -1e-3;
            assert!(cholesky(matrix.clone()).is_none());
            matrix[(n - 1, n - 1)] = f64::NAN;
            assert!(cholesky(matrix).is_none());
        }
    }
}
