//! The dual program of a fit as a conic program.
//!
//! The variables are the moments m, those of the sources they come from, and the functional s on
//! the Hessian form. In a fit the source is the weights of the points (`program`), around whole
//! sets it is a functional y for each set (`enclose`). Where a log det is measured, its matrix X is
//! cut into groups of rows by the degree of their monomials, and with Δ_k the part of a group that
//! the groups before it leave,
//!
//! ```text
//! X_{<=k} - E Δ_k Eᵀ ⪰ 0,   [[Δ_k, Z_k], [Z_kᵀ, diag Z_k]] ⪰ 0,  Z_k lower triangular
//! ```
//!
//! give `det X = Π det Δ_k >= Π (Z_k)_ii`: blocks of at most twice a group, in place of one of
//! twice the matrix. The geometric mean of those n numbers is maximised while the linear part of
//! the dual objective is held at n. Both are homogeneous, so that is the log det's optimum, with
//! multipliers that are p and its Gram matrices but for the factor that the multiplier of that
//! equation is.
//!
//! Where `tr Q⁻¹` is measured, `tr X^½ = max tr Y` subject to `[[X, Y], [Yᵀ, I]] ⪰ 0`; with T the
//! change of frame and `Y = T Z`, that is `[[M, Z], [Zᵀ, I]] ⪰ 0`. It is homogeneous, too, of
//! degree one half, and is maximised in the same way.

use super::FitError;
use super::conic_program::{ConicProgram, ConicSolution, Expression, geometric_mean, solve};
use super::localizing::{LocalizingMatrix, scales};
use super::objective::{Function, Matrix};
use super::path::Interior;
use super::program::Problem;
use super::progress::Watch;
use super::structure::{Pattern, interior_form, isotropic_form};
use super::unsolved::{ProgramError, Stop};
use nalgebra::{Cholesky, DMatrix, DVector};
use std::ops::Range;
use sublevel_core::polynomial::degree_of;

/// Tolerance asked of the solver; dimensionless.
///
/// 1e-8 leaves a gap of 1e-4 of log dets at degree 6 and of 1e-3 at degree 8, which fails the check
/// of optimality; a smaller value ends in stalls. Pinned by `both_solvers_agree`.
const TOLERANCE: f64 = 1e-9;

/// What moments come from.
pub(super) struct Source<'a> {
    /// What its variables add to m: monomials of p x variables.
    pub(super) map: &'a DMatrix<f64>,
    /// Their part in the linear part of the dual objective.
    pub(super) cost: DVector<f64>,
    /// Matrices that stay semidefinite, and by what margin their Gram matrices are definite,
    /// relative to the scales of their rows; none if the variables themselves stay nonnegative.
    pub(super) cones: Option<(&'a [LocalizingMatrix], f64)>,
    /// Variables in the interior of all that.
    pub(super) inside: DVector<f64>,
}

/// The optimum of a program by the conic solver.
#[derive(Clone, Debug)]
pub(super) struct MomentOptimum {
    /// The polynomial and the Gram matrix of its Hessian form.
    pub(super) interior: Interior,
    /// Gram matrix P of the polynomial.
    pub(super) gram: DMatrix<f64>,
    /// Gram matrices of each source's cones.
    pub(super) grams: Vec<Vec<DMatrix<f64>>>,
    /// No polynomial has a smaller objective: the dual objective of a feasible point.
    pub(super) lower_bound: f64,
    /// How the solver ended, if short of its tolerance.
    pub(super) stop: Option<Stop>,
}

/// The program of some sources.
pub(super) struct MomentProgram<'a> {
    problem: &'a Problem<'a>,
    sources: Vec<Source<'a>>,
    program: ConicProgram,
    /// Variables.
    moments: Range<usize>,
    form: Range<usize>,
    of_sources: Vec<Range<usize>>,
    /// Rows: `m = Σ map y - D*s`, whose multipliers are p.
    definition: Range<usize>,
    /// Row of the equation that holds the linear part.
    normalisation: usize,
    /// The constraints on each matrix, whose multipliers add up to its Gram matrix.
    of_moments: Vec<Part>,
    of_form: Vec<Part>,
    /// Rows of the constraints of each source's cones.
    of_cones: Vec<Vec<Range<usize>>>,
}

/// A moment matrix among the variables, its rows and columns scaled (`localizing`).
struct MomentMatrix<'a> {
    pattern: &'a Pattern,
    /// The variable of key 0.
    first: usize,
    /// One factor per row.
    scales: Vec<f64>,
}

impl MomentMatrix<'_> {
    /// A scaled entry.
    fn entry(&self, i: usize, j: usize) -> Expression {
        Expression::default().plus(self.scales[i] * self.scales[j], self.first + self.pattern.key(i, j))
    }

    /// Constrains the part of some rows.
    fn part(&self, rows: Range<usize>, basis: Vec<usize>) -> Part {
        let scales = basis.iter().map(|&row| self.scales[row]).collect();
        Part { rows, basis, scales }
    }
}

/// A semidefinite constraint on a part of a moment matrix.
struct Part {
    /// Its rows in the program.
    rows: Range<usize>,
    /// The rows of the matrix.
    basis: Vec<usize>,
    /// Their scales.
    scales: Vec<f64>,
}

impl<'a> MomentProgram<'a> {
    /// The program over the points whose monomials are the columns of `values`.
    pub(super) fn of_points(problem: &'a Problem, values: &'a DMatrix<f64>) -> Self {
        let points = values.ncols();
        let inside = DVector::repeat(points, problem.structure.gram.size as f64 / points as f64);
        Self::new(problem, vec![Source { map: values, cost: DVector::repeat(points, 1.0), cones: None, inside }])
    }

    /// The program of some sources.
    pub(super) fn new(problem: &'a Problem, sources: Vec<Source<'a>>) -> Self {
        let structure = problem.structure;
        let mut program = ConicProgram::default();
        let moments = program.variables(structure.monomials.len());
        let form = program.variables(structure.hessian.keys);
        let of_sources: Vec<_> = sources.iter().map(|source| program.variables(source.cost.len())).collect();
        let mut of_key: Vec<Expression> =
            moments.clone().map(|moment| Expression::default().plus(-1.0, moment)).collect();
        for (source, variables) in sources.iter().zip(&of_sources) {
            for (variable, column) in variables.clone().zip(source.map.column_iter()) {
                for (expression, &factor) in of_key.iter_mut().zip(column.iter()).filter(|(_, factor)| **factor != 0.0)
                {
                    expression.terms.push((variable, factor));
                }
            }
        }
        for (key, &(monomial, factor)) in structure.derivative.iter().enumerate() {
            of_key[monomial].terms.push((form.start + key, -factor));
        }
        let definition = program.zero(of_key);
        let of_cones = sources.iter().zip(&of_sources).map(|(source, y)| source.constrain(&mut program, y)).collect();
        let mut this = Self {
            problem,
            sources,
            program,
            moments,
            form,
            of_sources,
            definition,
            normalisation: 0,
            of_moments: Vec::new(),
            of_form: Vec::new(),
            of_cones,
        };
        this.measure();
        this.keep_definite();
        this
    }

    /// The linear part of the dual objective, `Σ cost - ε tr S + h·s`.
    fn cost(&self) -> Vec<(usize, f64)> {
        let of_form = self.problem.form_cost();
        let of_sources = self.sources.iter().zip(&self.of_sources);
        let of_sources =
            of_sources.flat_map(|(source, y)| y.clone().zip(source.cost_with_margin().data.as_vec().clone()));
        self.form.clone().zip(of_form.data.as_vec().clone()).chain(of_sources).filter(|term| term.1 != 0.0).collect()
    }

    /// A moment matrix, scaled by what it is inside the sources.
    fn matrix(&self, matrix: Matrix) -> MomentMatrix<'a> {
        let structure = self.problem.structure;
        let mean: DVector<f64> = self.sources.iter().map(|source| source.map * &source.inside).sum();
        match matrix {
            Matrix::Polynomial => {
                let (pattern, first) = (&structure.gram, self.moments.start);
                MomentMatrix { pattern, first, scales: scales(pattern.spread(&mean)) }
            }
            Matrix::Hessian => {
                let (pattern, first) = (&structure.hessian, self.form.start);
                let mut isotropic = isotropic_form(structure, &mean);
                if let Some(allowance) = &self.problem.allowance {
                    // It costs no more than all of the linear part.
                    isotropic *= (structure.gram.size as f64 / allowance.dot(&isotropic)).min(1.0);
                }
                MomentMatrix { pattern, first, scales: scales(pattern.spread(&isotropic)) }
            }
        }
    }

    /// The objective.
    fn measure(&mut self) {
        let matrix = self.problem.matrix;
        let moments = self.matrix(matrix);
        let parts = match self.problem.spectral.function() {
            Function::LogDet => {
                let groups = self.groups();
                let (parts, factors) = log_det(&mut self.program, &moments, &groups);
                let mean = geometric_mean(&mut self.program, &factors);
                self.program.add_cost(mean, -1.0);
                parts
            }
            Function::TraceInverse => {
                vec![trace_of_root(&mut self.program, &moments, self.problem.spectral.change())]
            }
        };
        let terms = self.cost().into_iter().map(|(variable, factor)| (variable, -factor)).collect();
        let held = Expression { terms, constant: moments.pattern.size as f64 };
        self.normalisation = self.program.zero([held]).start;
        match matrix {
            Matrix::Polynomial => self.of_moments = parts,
            Matrix::Hessian => self.of_form = parts,
        }
    }

    /// The matrix that is not measured is semidefinite.
    fn keep_definite(&mut self) {
        let moments = match self.problem.matrix {
            Matrix::Polynomial => self.matrix(Matrix::Hessian),
            Matrix::Hessian => self.matrix(Matrix::Polynomial),
        };
        let size = moments.pattern.size;
        if size == 0 {
            return;
        }
        // By about as much as the solver may be in error, so that its dual point mostly is feasible
        // as it is.
        let rows = self.program.semidefinite(size, |i, j| {
            let constant = if i == j { -TOLERANCE } else { 0.0 };
            Expression { constant, ..moments.entry(i, j) }
        });
        let constraint = vec![moments.part(rows, (0..size).collect())];
        match self.problem.matrix {
            Matrix::Polynomial => self.of_form = constraint,
            Matrix::Hessian => self.of_moments = constraint,
        }
    }

    /// The rows of the measured matrix by the degree of their monomials.
    fn groups(&self) -> Vec<Vec<usize>> {
        let structure = self.problem.structure;
        let degrees: Vec<usize> = match self.problem.matrix {
            Matrix::Polynomial => structure.monomials[..structure.gram.size].iter().map(|&e| degree_of(e)).collect(),
            Matrix::Hessian => structure.hessian_basis.iter().map(|b| degree_of(b.exponents)).collect(),
        };
        (0..=structure.degree / 2)
            .map(|degree| (0..degrees.len()).filter(|&row| degrees[row] == degree).collect())
            .filter(|rows: &Vec<usize>| !rows.is_empty())
            .collect()
    }

    /// Solves it.
    ///
    /// # Errors
    /// [`FitError::Cancelled`]; [`ProgramError`] where the solver has no answer, or one that gives
    /// no dual point.
    pub(super) fn solve(&self, watch: &mut Watch) -> Result<MomentOptimum, FitError> {
        let structure = self.problem.structure;
        let solution = solve(&self.program, TOLERANCE, self.problem.pattern().size as f64, watch)?;
        let stop = solution.stop;
        let factor = solution.multipliers[self.normalisation];
        if !(factor > 0.0) {
            return Err(ProgramError::singular(stop).into());
        }
        let coefficients = solution.multipliers(self.definition.clone()) / factor;
        let sum = |constraints: &[Part], size| gram(&solution, constraints, size) / factor;
        let gram = structure.gram.nearest(&sum(&self.of_moments, structure.gram.size), &coefficients);
        let mut form = structure.derivative_matrix() * &coefficients;
        if let Some(allowance) = &self.problem.allowance {
            form += allowance;
        }
        let size = structure.hessian.size;
        let hessian = sum(&self.of_form, size) + DMatrix::identity(size, size) * self.problem.margin;
        let hessian = structure.hessian.nearest(&hessian, &form);
        let lower_bound = self.lower_bound(&solution).ok_or_else(|| ProgramError::singular(stop))?;
        let of_source = |(source, rows): (&Source, &Vec<Range<usize>>)| source.grams(&solution, rows, factor);
        let grams = self.sources.iter().zip(&self.of_cones).map(of_source).collect();
        Ok(MomentOptimum { interior: Interior { coefficients, hessian }, gram, grams, lower_bound, stop })
    }

    /// The dual objective of the solver's dual point made feasible: as much of a point inside added
    /// as makes all matrices definite, and the best multiple of that.
    fn lower_bound(&self, solution: &ConicSolution) -> Option<f64> {
        let Self { problem, sources, .. } = self;
        let (gram, hessian) = (&problem.structure.gram, &problem.structure.hessian);
        let moments = |of_sources: &[DVector<f64>], form: &DVector<f64>| {
            let of_sources: DVector<f64> = sources.iter().zip(of_sources).map(|(source, y)| source.map * y).sum();
            of_sources - problem.structure.pull_back(form)
        };
        let y: Vec<_> = self.of_sources.iter().map(|y| solution.values(y.clone())).collect();
        let s = solution.values(self.form.clone());
        let inside: Vec<_> = sources.iter().map(|source| source.inside.clone()).collect();
        let rows = gram.size as f64;
        let nothing = DVector::zeros(hessian.keys);
        // Points on a surface of low degree, as those of a torus, have a singular moment matrix
        // whatever their weights: it is the functional s that makes that of the solution definite.
        // Where rounding or the optimum itself leaves that one singular or nearly so, there are the
        // points.
        let inside_forms = [
            interior_form(problem.structure, &moments(&y, &s), 1.0),
            interior_form(problem.structure, &(moments(&inside, &nothing) / rows), rows),
            // The solver's point has to be feasible as it is.
            Some(nothing),
        ];
        let feasible = |inside_form: &DVector<f64>, share: f64| {
            let form = &s + inside_form * share;
            Cholesky::new(hessian.spread(&form))?;
            let of_source = |(source, y): (&Source, &DVector<f64>)| source.feasible(y, share);
            let of_sources = sources.iter().zip(&y).map(of_source).collect::<Option<Vec<_>>>()?;
            let moments = moments(&of_sources, &form);
            Cholesky::new(gram.spread(&moments))?;
            Some((of_sources, form, moments))
        };
        let of_form = |form: &DVector<f64>| shares().find_map(|share| feasible(form, share));
        let (of_sources, form, moments) = inside_forms.iter().flatten().find_map(of_form)?;
        let cost: f64 = sources.iter().zip(&of_sources).map(|(source, y)| source.cost_with_margin().dot(y)).sum();
        let cost = cost + problem.form_cost().dot(&form);
        problem.spectral.best_multiple(&problem.measured(&moments, &form), cost)
    }
}

/// Parts of something inside, from none to what no longer is an error of rounding.
fn shares() -> impl Iterator<Item = f64> {
    std::iter::once(0.0).chain((0..20).map(|step| 1e-12 * 3_f64.powi(step)))
}

impl Source<'_> {
    /// The cost of its variables, less what the margin of its Gram matrices takes off.
    fn cost_with_margin(&self) -> DVector<f64> {
        let mut cost = self.cost.clone();
        if let Some((cones, margin)) = self.cones {
            cones.iter().flat_map(LocalizingMatrix::trace).for_each(|(k, factor)| cost[k] -= margin * factor);
        }
        cost
    }

    /// Constrains its variables; rows of the constraints of its cones.
    fn constrain(&self, program: &mut ConicProgram, variables: &Range<usize>) -> Vec<Range<usize>> {
        let Some((cones, _)) = self.cones else {
            program.nonnegative(variables.clone().map(Expression::of));
            return Vec::new();
        };
        cones.iter().map(|cone| cone.constrain(program, variables.start)).collect()
    }

    /// The Gram matrices of its cones.
    fn grams(&self, solution: &ConicSolution, rows: &[Range<usize>], factor: f64) -> Vec<DMatrix<f64>> {
        let Some((cones, margin)) = self.cones else { return Vec::new() };
        cones.iter().zip(rows).map(|(cone, rows)| cone.gram(solution, rows.clone(), factor, margin)).collect()
    }

    /// Variables with a share of what is inside, where that is feasible.
    fn feasible(&self, y: &DVector<f64>, share: f64) -> Option<DVector<f64>> {
        let inside = &self.inside * share;
        let Some((cones, _)) = self.cones else { return Some(y.map(|weight| weight.max(0.0)) + inside) };
        let y = y + inside;
        cones.iter().all(|cone| cone.is_definite(&y)).then_some(y)
    }
}

/// The Gram matrix that the multipliers of constraints on parts of a moment matrix add up to.
fn gram(solution: &ConicSolution, parts: &[Part], size: usize) -> DMatrix<f64> {
    let mut gram = DMatrix::zeros(size, size);
    for Part { rows, basis, scales } in parts {
        let width = basis.len();
        let part = solution.matrix_multiplier(rows.clone(), width);
        for i in 0..width {
            for j in 0..width {
                gram[(basis[i], basis[j])] += scales[i] * scales[j] * part[(i, j)];
            }
        }
    }
    gram
}

/// Constrains new variables, as many as rows, so that their product is at most the determinant of
/// the scaled moment matrix. Returns the constraints on parts of the matrix, and the variables.
fn log_det(program: &mut ConicProgram, moments: &MomentMatrix, groups: &[Vec<usize>]) -> (Vec<Part>, Vec<usize>) {
    let (mut parts, mut factors, mut known) = (Vec::new(), Vec::new(), Vec::new());
    for group in groups {
        let (before, width) = (known.len(), group.len());
        known.extend(group.iter().copied());
        // The upper triangle of Δ, and the lower one of Z, where Z_ji is kept at (i, j).
        let at = |i: usize, j: usize| j * (j + 1) / 2 + i;
        let count = width * (width + 1) / 2;
        let left = program.variables(count).start;
        let root = if width == 1 { left } else { program.variables(count).start };
        let rows = program.semidefinite(known.len(), |i, j| {
            let entry = moments.entry(known[i], known[j]);
            if i < before { entry } else { entry.plus(-1.0, left + at(i - before, j - before)) }
        });
        parts.push(moments.part(rows, known.clone()));
        if width > 1 {
            program.semidefinite(2 * width, |i, j| match (i < width, j < width) {
                (true, true) => Expression::of(left + at(i, j)),
                (true, false) if i >= j - width => Expression::of(root + at(j - width, i)),
                (false, false) if i == j => Expression::of(root + at(i - width, i - width)),
                _ => Expression::default(),
            });
        }
        factors.extend((0..width).map(|i| root + at(i, i)));
    }
    (parts, factors)
}

/// Adds a negative multiple of `tr (T X Tᵀ)^½` of the moment matrix X to the cost. Returns the
/// constraint on X.
fn trace_of_root(program: &mut ConicProgram, moments: &MomentMatrix, change: Option<&DMatrix<f64>>) -> Part {
    let size = moments.pattern.size;
    let identity = DMatrix::identity(size, size);
    // tr T Z, and Z has the scales of the rows of X
    let mut costs = change.unwrap_or(&identity).transpose();
    for (mut row, scale) in costs.row_iter_mut().zip(&moments.scales) {
        row /= *scale;
    }
    costs /= costs.norm();
    let root = program.variables(size * size).start;
    for (variable, cost) in (root..).zip(costs.iter()) {
        program.add_cost(variable, -cost);
    }
    let rows = program.semidefinite(2 * size, |i, j| match (i < size, j < size) {
        (true, true) => moments.entry(i, j),
        (true, false) => Expression::of(root + (j - size) * size + i),
        _ => Expression::constant(if i == j { 1.0 } else { 0.0 }),
    });
    moments.part(rows, (0..size).collect())
}
