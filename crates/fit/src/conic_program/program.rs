//! How a conic program is stated.

use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT;
use nalgebra::DMatrix;
use std::f64::consts::SQRT_2;
use std::ops::Range;

/// An affine expression `constant + Σ factor x_variable`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Expression {
    /// Variable and factor.
    pub(crate) terms: Vec<(usize, f64)>,
    /// What is added.
    pub(crate) constant: f64,
}

impl Expression {
    /// A variable itself.
    pub(crate) fn of(variable: usize) -> Self {
        Self { terms: vec![(variable, 1.0)], constant: 0.0 }
    }

    /// A number.
    pub(crate) fn constant(constant: f64) -> Self {
        Self { terms: Vec::new(), constant }
    }

    /// It with a term more.
    pub(crate) fn plus(mut self, factor: f64, variable: usize) -> Self {
        self.terms.push((variable, factor));
        self
    }
}

/// `minimise ½ xᵀQx + c·x`, x free, with expressions of x in cones.
///
/// Each constraint returns the rows of its multipliers in the solution: with multipliers z of
/// expressions e, `Qx + c = Σ z ∇e` at the optimum, z free for equations and in the dual cone for
/// the others.
#[derive(Clone, Debug, Default)]
pub(crate) struct ConicProgram {
    linear: Vec<f64>,
    /// Upper triangle of Q: row, column, value.
    quadratic: Vec<(usize, usize, f64)>,
    /// Row, column, value.
    entries: Vec<(usize, usize, f64)>,
    constants: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
}

/// A program as clarabel takes it: Q, c, A, b and the cones.
pub(super) type Standard<'a> = (CscMatrix<f64>, &'a [f64], CscMatrix<f64>, &'a [f64], &'a [SupportedConeT<f64>]);

impl ConicProgram {
    /// A new variable with a cost.
    pub(crate) fn variable(&mut self, cost: f64) -> usize {
        self.linear.push(cost);
        self.linear.len() - 1
    }

    /// New variables without cost.
    pub(crate) fn variables(&mut self, count: usize) -> Range<usize> {
        let first = self.linear.len();
        self.linear.resize(first + count, 0.0);
        first..first + count
    }

    /// Adds to the cost of a variable.
    pub(crate) fn add_cost(&mut self, variable: usize, cost: f64) {
        self.linear[variable] += cost;
    }

    /// Adds `½ vᵀQv` to the objective, v the variables from `first` on.
    pub(crate) fn add_quadratic(&mut self, first: usize, matrix: &DMatrix<f64>) {
        for j in 0..matrix.ncols() {
            self.quadratic.extend((0..=j).map(|i| (first + i, first + j, matrix[(i, j)])));
        }
    }

    /// All expressions are zero.
    pub(crate) fn zero(&mut self, expressions: impl IntoIterator<Item = Expression>) -> Range<usize> {
        self.constrain(expressions, SupportedConeT::ZeroConeT)
    }

    /// All expressions are nonnegative.
    pub(crate) fn nonnegative(&mut self, expressions: impl IntoIterator<Item = Expression>) -> Range<usize> {
        self.constrain(expressions, SupportedConeT::NonnegativeConeT)
    }

    /// The first expression is at least the norm of the others.
    pub(crate) fn second_order(&mut self, expressions: impl IntoIterator<Item = Expression>) -> Range<usize> {
        self.constrain(expressions, SupportedConeT::SecondOrderConeT)
    }

    /// The symmetric matrix of expressions, given for `row <= column`, is positive semidefinite.
    pub(crate) fn semidefinite(
        &mut self,
        size: usize,
        expression: impl Fn(usize, usize) -> Expression,
    ) -> Range<usize> {
        let first = self.constants.len();
        for j in 0..size {
            for i in 0..=j {
                self.row(expression(i, j), if i == j { 1.0 } else { SQRT_2 });
            }
        }
        self.cones.push(SupportedConeT::PSDTriangleConeT(size));
        first..self.constants.len()
    }

    fn constrain(
        &mut self,
        expressions: impl IntoIterator<Item = Expression>,
        cone: impl Fn(usize) -> SupportedConeT<f64>,
    ) -> Range<usize> {
        let first = self.constants.len();
        expressions.into_iter().for_each(|expression| self.row(expression, 1.0));
        let rows = first..self.constants.len();
        if !rows.is_empty() {
            self.cones.push(cone(rows.len()));
        }
        rows
    }

    fn row(&mut self, expression: Expression, scale: f64) {
        let row = self.constants.len();
        self.entries.extend(expression.terms.into_iter().map(|(column, factor)| (row, column, -scale * factor)));
        self.constants.push(scale * expression.constant);
    }

    /// Whether there is a semidefinite cone.
    pub(super) fn has_semidefinite(&self) -> bool {
        self.cones.iter().any(|cone| matches!(cone, SupportedConeT::PSDTriangleConeT(_)))
    }

    /// Whether all its numbers are finite.
    pub(super) fn is_finite(&self) -> bool {
        let entries = self.entries.iter().chain(&self.quadratic).map(|entry| &entry.2);
        entries.chain(&self.linear).chain(&self.constants).all(|value| value.is_finite())
    }

    /// The program as clarabel takes it.
    pub(super) fn standard(&self) -> Standard<'_> {
        let matrix = |rows: usize, entries: &[(usize, usize, f64)]| {
            let (i, (j, v)) = entries.iter().map(|&(row, column, value)| (row, (column, value))).unzip();
            CscMatrix::new_from_triplets(rows, self.linear.len(), i, j, v)
        };
        let (quadratic, constraints) =
            (matrix(self.linear.len(), &self.quadratic), matrix(self.constants.len(), &self.entries));
        (quadratic, &self.linear, constraints, &self.constants, &self.cones)
    }
}

/// A new variable that is at most the geometric mean of nonnegative variables: a binary tree of
/// `y² <= a b`, each a second-order cone, its missing leaves the mean itself (Ben-Tal and
/// Nemirovski, Lectures on Modern Convex Optimization, 2.3.5).
pub(crate) fn geometric_mean(program: &mut ConicProgram, variables: &[usize]) -> usize {
    let mean = program.variable(0.0);
    let mut level = variables.to_vec();
    level.resize(variables.len().next_power_of_two(), mean);
    if level.len() == 1 {
        program.nonnegative([Expression::of(level[0]).plus(-1.0, mean)]);
        return mean;
    }
    while level.len() > 1 {
        let last = level.len() == 2;
        let pairs: Vec<[usize; 2]> = level.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect();
        level = pairs
            .into_iter()
            .map(|[a, b]| {
                // the root of a pair of means is the mean
                if a == mean && b == mean {
                    return mean;
                }
                let root = if last { mean } else { program.variable(0.0) };
                let twice = Expression { terms: vec![(root, 2.0)], constant: 0.0 };
                program.second_order([Expression::of(a).plus(1.0, b), Expression::of(a).plus(-1.0, b), twice]);
                root
            })
            .collect();
    }
    mean
}
