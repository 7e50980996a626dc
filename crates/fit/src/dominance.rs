//! Gram matrices of Hessian forms as sums of small blocks.
//!
//! A scaled diagonally dominant matrix is a sum of semidefinite blocks `[[u + v, w], [w, u - v]]`
//! on two rows each, (u, v, w) in a Lorentz cone; a diagonally dominant one has only those with v =
//! 0, and a nonnegative diagonal (Ahmadi and Majumdar, SIAM J. Appl. Algebra Geometry 3, 2019).

use super::Cone;
use super::conic_program::{ConicProgram, ConicSolution, Expression};
use super::structure::Structure;
use nalgebra::DMatrix;
use std::ops::Range;

/// The blocks of the Gram matrices of one degree.
#[derive(Clone, Debug)]
pub(super) struct Dominance<'a> {
    structure: &'a Structure,
    cone: Cone,
    /// Rows of each block.
    pairs: Vec<[usize; 2]>,
}

/// Variables of the blocks in a program.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// Three per pair: u, v, w; v is missing where it is zero.
    pairs: Range<usize>,
    /// The entries of the diagonal alone, if there are any.
    diagonal: Range<usize>,
}

impl<'a> Dominance<'a> {
    /// The blocks of scaled diagonal dominance, or of diagonal dominance.
    pub(super) fn new(structure: &'a Structure, cone: Cone) -> Self {
        let pairs = (0..structure.hessian.size).flat_map(|j| (0..j).map(move |i| [i, j])).collect();
        Self { structure, cone, pairs }
    }

    fn is_scaled(&self) -> bool {
        self.cone == Cone::Sdsos
    }

    /// Variables of one block: u, v if there is one, w.
    fn of_pair(&self, blocks: &Blocks, index: usize) -> (usize, Option<usize>, usize) {
        if self.is_scaled() {
            let first = blocks.pairs.start + 3 * index;
            (first, Some(first + 1), first + 2)
        } else {
            let first = blocks.pairs.start + 2 * index;
            (first, None, first + 1)
        }
    }

    /// Adds blocks to a program, each in its cone, that add up to a Gram matrix of `form`, one
    /// expression for each coefficient of the Hessian form.
    pub(super) fn constrain(&self, program: &mut ConicProgram, mut form: Vec<Expression>) -> Blocks {
        let pattern = &self.structure.hessian;
        let width = if self.is_scaled() { 3 } else { 2 };
        let blocks = Blocks {
            pairs: program.variables(width * self.pairs.len()),
            diagonal: program.variables(if self.is_scaled() { 0 } else { pattern.size }),
        };
        let mut subtract = |key: usize, factor: f64, variable: usize| form[key].terms.push((variable, -factor));
        for (index, &[i, j]) in self.pairs.iter().enumerate() {
            let (u, v, w) = self.of_pair(&blocks, index);
            subtract(pattern.key(i, i), 1.0, u);
            subtract(pattern.key(j, j), 1.0, u);
            if let Some(v) = v {
                subtract(pattern.key(i, i), 1.0, v);
                subtract(pattern.key(j, j), -1.0, v);
            }
            subtract(pattern.key(i, j), 2.0, w);
        }
        for (i, entry) in blocks.diagonal.clone().enumerate() {
            subtract(pattern.key(i, i), 1.0, entry);
        }
        program.zero(form);
        for index in 0..self.pairs.len() {
            let (u, v, w) = self.of_pair(&blocks, index);
            match v {
                Some(v) => program.second_order([u, v, w].map(Expression::of)),
                None => program.nonnegative([1.0, -1.0].map(|sign| Expression::of(u).plus(sign, w))),
            };
        }
        program.nonnegative(blocks.diagonal.clone().map(Expression::of));
        blocks
    }

    /// The Gram matrix that the blocks of a solution add up to.
    pub(super) fn gram(&self, blocks: &Blocks, solution: &ConicSolution) -> DMatrix<f64> {
        let size = self.structure.hessian.size;
        let mut gram = DMatrix::zeros(size, size);
        for (index, &[i, j]) in self.pairs.iter().enumerate() {
            let (u, v, w) = self.of_pair(blocks, index);
            let value = |variable: usize| solution.variables[variable];
            let tilt = v.map_or(0.0, value);
            gram[(i, i)] += value(u) + tilt;
            gram[(j, j)] += value(u) - tilt;
            gram[(i, j)] = value(w);
            gram[(j, i)] = value(w);
        }
        for (i, entry) in blocks.diagonal.clone().enumerate() {
            gram[(i, i)] += solution.variables[entry];
        }
        gram
    }
}
