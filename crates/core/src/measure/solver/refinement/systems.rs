//! Newton's matrices, from what is known at an iterate in doubles; residuals have more digits.

use crate::measure::solver::kkt_newton::At;
use crate::measure::solver::linear_systems::{Augmented, MAX_UNKNOWNS, solve};
use nalgebra::Matrix3;

/// Newton's matrix of the system of the distance for dx, dy, dD and the multipliers, from what is
/// known at the iterate and the counts of active constraints; column `7 + la + lb` is left to the
/// residuals.
pub(super) fn distance_matrix(distance: f64, a: &At, b: &At, la: usize, lb: usize) -> Augmented {
    let mut m: Augmented = [[0.0; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];
    let scaled = a.hessian * distance;
    let turned = a.hessian * a.sum;
    for i in 0..3 {
        for j in 0..3 {
            m[i][j] = scaled[(i, j)] + f64::from(u8::from(i == j));
            m[3 + i][j] = a.hessian[(i, j)];
            m[3 + i][3 + j] = b.hessian[(i, j)];
        }
        m[i][3 + i] = -1.0;
        m[i][6] = a.sum[i];
        m[6][i] = turned[i];
        for k in 0..la {
            m[i][7 + k] = distance * a.gradient[k][i];
            m[3 + i][7 + k] = a.gradient[k][i];
            m[7 + k][i] = a.gradient[k][i];
        }
        for k in 0..lb {
            m[3 + i][7 + la + k] = b.gradient[k][i];
            m[7 + la + k][3 + i] = b.gradient[k][i];
        }
    }
    for k in 0..la {
        m[6][7 + k] = a.sum.dot(&a.gradient[k]);
    }
    m
}

/// Newton's matrix of the level distance, unknowns x, s and the multipliers; column `4 + la + lb`
/// is left to the residuals.
pub(super) fn level_matrix(a: &At, b: &At, la: usize, lb: usize) -> Augmented {
    let hessian = a.hessian + b.hessian;
    let mut m: Augmented = [[0.0; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];
    for i in 0..3 {
        (0..3).for_each(|j| m[i][j] = hessian[(i, j)]);
        for (k, gradient) in a.gradient[..la].iter().chain(&b.gradient[..lb]).enumerate() {
            m[i][4 + k] = gradient[i];
            m[4 + k][i] = gradient[i];
        }
    }
    for k in 0..la {
        m[3][4 + k] = 1.0;
        m[4 + k][3] = -1.0;
    }
    m
}

/// Newton's matrix of the distance from a segment or a point, unknowns x and the multipliers, from
/// the Hessian of the Lagrangian and the count of active constraints; column `3 + len` is left to
/// the residuals.
pub(super) fn axis_matrix(hessian: &Matrix3<f64>, at: &At, len: usize) -> Augmented {
    let mut m: Augmented = [[0.0; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];
    for i in 0..3 {
        (0..3).for_each(|j| m[i][j] = hessian[(i, j)]);
        for (k, gradient) in at.gradient[..len].iter().enumerate() {
            m[i][3 + k] = gradient[i];
            m[3 + k][i] = gradient[i];
        }
    }
    m
}

/// Solves a system with columns of one size: needles make them differ.
pub(super) fn equilibrated(m: &mut Augmented, size: usize) -> Option<[f64; MAX_UNKNOWNS]> {
    let mut scale = [1.0; MAX_UNKNOWNS];
    // Rows first, so that no row of large entries decides alone.
    for row in m.iter_mut().take(size) {
        let most = row[..size].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        row[..=size].iter_mut().for_each(|entry| *entry /= most);
    }
    for (j, scale) in scale.iter_mut().enumerate().take(size) {
        *scale = (0..size).fold(0.0_f64, |most, i| most.max(m[i][j].abs()));
        (0..size).for_each(|i| m[i][j] /= *scale);
    }
    let mut solution = solve(m, size)?;
    solution.iter_mut().zip(&scale).take(size).for_each(|(value, scale)| *value /= scale);
    solution[..size].iter().all(|value| value.is_finite()).then_some(solution)
}
