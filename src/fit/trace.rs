//! The trace objectives as one linear semidefinite program each.
//!
//! The function `tr X^½` of the dual (`spectral`) is no barrier: damped Newton steps on it creep along the boundary of its
//! domain. Written with `Y = X^½` by a Schur complement, as the paper writes `tr V` with `V ⪰ Q⁻¹`, the dual is linear:
//!
//! ```text
//! minimise  Σwᵢ - ε tr S - 2 tr Y   subject to  [[I, Y], [Y, X]] ⪰ 0,  w >= 0,  and the other matrix ⪰ 0
//! ```
//!
//! with X the moment matrix of the measured Gram matrix in the unit frame. The multiplier of its block X is that Gram matrix.

use super::objective::Matrix;
use super::program::{Dual, Problem, ProgramError};
use super::quadratic::{Columns, Program, Step, packed, packed_size, push_signs, unpacked};
use super::spectral::symmetric;
use nalgebra::{Cholesky, DMatrix, DVector};
use std::f64::consts::SQRT_2;

/// Solves the program over the points whose monomials are the columns of `values`.
///
/// The step it returns is the whole way: its decrement is 0, and its lower bound is there with it.
pub(super) fn solve(problem: &Problem, values: &DMatrix<f64>) -> Result<(Step, f64), ProgramError> {
    let structure = problem.structure;
    let (points, forms, size) = (values.ncols(), structure.hessian.keys, problem.pattern().size);
    let other = match problem.matrix {
        Matrix::Polynomial => &structure.hessian,
        Matrix::Hessian => &structure.gram,
    };
    let block = Block { size, row: points };
    let cone = points + block.rows();
    let mut columns = Columns::new(cone + packed_size(other));
    let unit = problem.spectral.unit_matrices(problem.pattern());
    let in_other = packed(other, cone);
    // How a change of moments and of s shows in the two cones.
    let of_moments = |moments: &DVector<f64>| -> Vec<(usize, f64)> {
        match problem.matrix {
            Matrix::Polynomial => block.lower(&combined(&unit, moments)),
            Matrix::Hessian => spread(&in_other, moments),
        }
    };
    for (i, value) in values.column_iter().enumerate() {
        columns.push(push_signs(i).into_iter().chain(of_moments(&value.into_owned())));
    }
    let mut unit_form = DVector::zeros(forms);
    for key in 0..forms {
        unit_form[key] = 1.0;
        let pulled = of_moments(&-structure.pull_back(&unit_form));
        unit_form[key] = 0.0;
        let (first, second) = match problem.matrix {
            Matrix::Polynomial => (pulled, in_other[key].clone()),
            Matrix::Hessian => (block.lower(&unit[key]), pulled),
        };
        columns.push(first.into_iter().chain(second));
    }
    let mut linear = vec![1.0; points];
    linear.resize(points + forms, 0.0);
    for i in 0..structure.hessian.size {
        linear[points + structure.hessian.key(i, i)] -= problem.margin;
    }
    for j in 0..size {
        for i in 0..=j {
            columns.push(block.corner(i, j));
            linear.push(if i == j { -2.0 } else { 0.0 });
        }
    }
    let mut right = vec![0.0; columns.rows()];
    block.identity(&mut right);
    let cones = vec![2 * size, other.size];
    let answer =
        Program { quadratic: 0, linear, columns, right, equalities: 0, points, cones }.solve(super::generate::FINE)?;

    let weights = DVector::from_iterator(points, answer.x.rows(0, points).iter().map(|w| w.max(0.0)));
    let form = answer.x.rows(points, forms).into_owned();
    let target = Dual { moments: values * &weights - structure.pull_back(&form), weights, form };
    let whole = unpacked(2 * size, &answer.z.as_slice()[points..cone]);
    let measured = symmetric(whole.view((size, size), (size, size)).into_owned());
    let remaining = unpacked(other.size, &answer.z.as_slice()[cone..]);
    let gram = problem.spectral.whitened(&measured);
    let (coefficients, hessian) = match problem.matrix {
        Matrix::Polynomial => {
            let identity = DMatrix::identity(other.size, other.size);
            (structure.gram.collapse(&gram), remaining + identity * problem.margin)
        }
        Matrix::Hessian => (structure.gram.collapse(&remaining), gram),
    };
    let scale = problem.spectral.scale();
    let root_trace: f64 = (0..size).map(|i| answer.x[points + forms + i * (i + 3) / 2]).sum();
    let bound = (2.0 * root_trace - problem.cost(&target)) / scale;
    let step = Step {
        target,
        coefficients,
        hessian,
        decrement: 0.0,
        primal: Cholesky::new(measured).map(|factor| factor.inverse().trace() / scale),
        full_accuracy: answer.full_accuracy,
        iterations: answer.iterations,
    };
    Ok((step, bound))
}

/// The cone of `[[I, Y], [Y, X]]`, its rows from `row` on.
struct Block {
    size: usize,
    row: usize,
}

impl Block {
    fn rows(&self) -> usize {
        self.size * (2 * self.size + 1)
    }

    /// Row of the entry (i, j), i <= j, of the upper triangle by columns.
    fn at(&self, i: usize, j: usize) -> usize {
        self.row + j * (j + 1) / 2 + i
    }

    /// X, negated as clarabel wants it.
    fn lower(&self, x: &DMatrix<f64>) -> Vec<(usize, f64)> {
        let n = self.size;
        let entries = (0..n).flat_map(|j| (0..=j).map(move |i| (i, j)));
        entries
            .map(|(i, j)| (self.at(n + i, n + j), -x[(i, j)] * if i == j { 1.0 } else { SQRT_2 }))
            .filter(|entry| entry.1 != 0.0)
            .collect()
    }

    /// The entries (i, j) and (j, i) of the symmetric Y.
    fn corner(&self, i: usize, j: usize) -> Vec<(usize, f64)> {
        let n = self.size;
        let mut entries = vec![(self.at(i, n + j), -SQRT_2)];
        if i != j {
            entries.insert(0, (self.at(j, n + i), -SQRT_2));
        }
        entries
    }

    fn identity(&self, right: &mut [f64]) {
        for i in 0..self.size {
            right[self.at(i, i)] = 1.0;
        }
    }
}

/// `Σ values[key] matrices[key]`.
fn combined(matrices: &[DMatrix<f64>], values: &DVector<f64>) -> DMatrix<f64> {
    let size = matrices.first().map_or(0, DMatrix::nrows);
    let mut sum = DMatrix::zeros(size, size);
    for (matrix, &value) in matrices.iter().zip(values) {
        if value != 0.0 {
            sum += matrix * value;
        }
    }
    sum
}

/// The entries of all keys, times their values.
fn spread(entries: &[Vec<(usize, f64)>], values: &DVector<f64>) -> Vec<(usize, f64)> {
    let mut all: Vec<(usize, f64)> =
        entries.iter().zip(values).flat_map(|(e, v)| e.iter().map(move |&(row, scale)| (row, scale * v))).collect();
    all.retain(|entry| entry.1 != 0.0);
    all.sort_unstable_by_key(|entry| entry.0);
    all
}
