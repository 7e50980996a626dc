//! Positive definiteness of a floating-point matrix, proven in floating-point arithmetic.

use super::rounding::gamma;
use nalgebra::DMatrix;

/// Whether `matrix - shift I` is proven positive definite; only the lower triangle is read.
///
/// Rump's criterion (Verification of positive definiteness, BIT 46, 2006): subtract `shift + c`,
/// rounded down, from the diagonal and run plain Cholesky; if it completes with positive pivots the
/// exact matrix is positive definite, where `c >= ½ γ_{2(n+1)} tr A + 4 η n (2(n+1) + max a_ii)`
/// bounds what the factorization can lose to rounding (`η = 2⁻¹⁰⁷⁴`).
pub(super) fn is_positive_definite_above(matrix: &DMatrix<f64>, shift: f64) -> bool {
    let n = matrix.nrows();
    let diagonal_ok = (0..n).all(|i| matrix[(i, i)].is_finite() && matrix[(i, i)] > 0.0);
    if n == 0 || n != matrix.ncols() || !diagonal_ok || !(shift >= 0.0) {
        return false;
    }
    let trace: f64 = (0..n).map(|i| matrix[(i, i)]).sum::<f64>() * (1.0 + gamma(n));
    let largest = (0..n).map(|i| matrix[(i, i)]).fold(0.0, f64::max);
    let tiny = f64::from_bits(1);
    let c = (0.5 * gamma(2 * (n + 1)) * trace) * (1.0 + 1e-14)
        + 4.0 * tiny * n as f64 * (2.0 * (n as f64 + 1.0) + largest) * (1.0 + 1e-14)
        + f64::MIN_POSITIVE;
    let lowered = (shift + c).next_up();
    let mut l = matrix.clone();
    for i in 0..n {
        l[(i, i)] = (l[(i, i)] - lowered).next_down();
    }
    for j in 0..n {
        for k in 0..j {
            let ljk = l[(j, k)];
            for i in j..n {
                l[(i, j)] -= l[(i, k)] * ljk;
            }
        }
        let pivot = l[(j, j)];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        let root = pivot.sqrt();
        for i in j..n {
            l[(i, j)] /= root;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separates_definite_from_indefinite() {
        // Hilbert matrix of order 6: smallest eigenvalue 1.08e-7.
        let hilbert = DMatrix::from_fn(6, 6, |i, j| 1.0 / (i + j + 1) as f64);
        assert!(is_positive_definite_above(&hilbert, 0.0));
        assert!(is_positive_definite_above(&hilbert, 1.0e-7));
        assert!(!is_positive_definite_above(&hilbert, 1.1e-7));
    }

    #[test]
    fn refuses_singular_nan_and_empty() {
        let singular = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 1.0, 1.0]);
        assert!(!is_positive_definite_above(&singular, 0.0));
        assert!(!is_positive_definite_above(&DMatrix::from_element(2, 2, f64::NAN), 0.0));
        assert!(!is_positive_definite_above(&DMatrix::zeros(0, 0), 0.0));
        assert!(!is_positive_definite_above(&DMatrix::identity(2, 2), f64::NAN));
    }
}
