//! Polynomials as full arrays of coefficients, and their Taylor expansions elsewhere.

use super::monomial::Exponents;

/// Coefficients of degree at most 8 by their exponents.
pub(super) type Dense = [[[f64; 9]; 9]; 9];

/// Of a polynomial with these terms.
pub(super) fn dense(terms: &[(Exponents, f64)]) -> Dense {
    let mut dense: Dense = [[[0.0; 9]; 9]; 9];
    for &([i, j, k], coefficient) in terms {
        dense[usize::from(i)][usize::from(j)][usize::from(k)] = coefficient;
    }
    dense
}

/// Replaces the coefficients of p by those of `p(z + by e_axis)`: synthetic division, line by line.
pub(super) fn shift(dense: &mut Dense, degree: usize, by: f64, axis: usize) {
    for i in 0..=degree {
        for j in 0..=degree - i {
            let longest = degree - i - j;
            let mut line = [0.0; 9];
            let place = |k: usize| match axis {
                0 => [k, i, j],
                1 => [i, k, j],
                _ => [i, j, k],
            };
            for k in 0..=longest {
                let [a, b, c] = place(k);
                line[k] = dense[a][b][c];
            }
            for start in 0..longest {
                for k in (start..longest).rev() {
                    line[k] += by * line[k + 1];
                }
            }
            for k in 0..=longest {
                let [a, b, c] = place(k);
                dense[a][b][c] = line[k];
            }
        }
    }
}

/// Coefficients of `p(z + by e_axis)`.
pub(super) fn shifted(dense: &Dense, degree: usize, by: f64, axis: usize) -> Dense {
    let mut result = *dense;
    shift(&mut result, degree, by, axis);
    result
}
