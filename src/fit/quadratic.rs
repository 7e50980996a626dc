//! One Newton step of a fit as a quadratic program, which clarabel solves.
//!
//! The multipliers of each such program are a polynomial p and Gram matrices that satisfy **all** constraints of the fit's
//! program for the points used, however far the Newton iteration still has to go.

use super::objective::Matrix;
use super::program::{Dual, Problem, ProgramError, regularised_factor};
use super::structure::Pattern;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{DMatrix, DVector};
// Links the BLAS that clarabel's semidefinite cones call.
use openblas_src as _;
use std::f64::consts::SQRT_2;

/// What one quadratic program gives.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// The minimiser of the quadratic model.
    pub(super) target: Dual,
    /// Coefficients of p, feasible for the points of the program.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form, `⪰ εI`.
    pub(super) hessian: DMatrix<f64>,
    /// Newton decrement: distance to the target in the local norm of φ.
    pub(super) decrement: f64,
    /// f of the measured Gram matrix, if that is positive definite.
    pub(super) primal: Option<f64>,
    /// Solved to full accuracy (not only "almost").
    pub(super) full_accuracy: bool,
    /// Interior-point iterations.
    pub(super) iterations: u32,
}

/// Maximises the quadratic model of the dual around `at`, over the points whose monomials are the columns of `values`, to
/// the solver's tolerance `tolerance`.
///
/// In the coordinates u with `x = x0 + R⁻¹u`, x the moments that φ depends on and `RᵀR` its curvature, the model is perfectly
/// conditioned. The rows stay those of m, where D has one entry per column: that keeps the factorization sparse.
pub(super) fn newton_step(
    problem: &Problem,
    values: &DMatrix<f64>,
    at: &Dual,
    tolerance: f64,
) -> Result<Step, ProgramError> {
    let structure = problem.structure;
    let measured = problem.measured(at);
    let gram = problem.spectral.minimiser(&measured).ok_or(ProgramError::Singular)?;
    let curvature = problem.spectral.curvature(problem.pattern(), &measured).ok_or(ProgramError::Singular)?;
    let lower = regularised_factor(&curvature).ok_or(ProgramError::Singular)?;
    let gradient = problem.pattern().collapse(&gram);
    let slope = lower.solve_lower_triangular(&gradient).ok_or(ProgramError::Singular)?;
    let upper = lower.transpose();
    let size = problem.pattern().keys;
    let inverse = upper.solve_upper_triangular(&DMatrix::identity(size, size)).ok_or(ProgramError::Singular)?;

    let model = Model { values, at: problem.variable(at), inverse: &inverse, slope: &slope };
    let program = match problem.matrix {
        Matrix::Polynomial => of_polynomial(problem, &model),
        Matrix::Hessian => of_hessian(problem, &model),
    };
    let Answer { x, z, full_accuracy, iterations } = program.solve(tolerance)?;

    let (count, points) = (structure.monomials.len(), values.ncols());
    let weights = DVector::from_iterator(points, x.rows(size, points).iter().map(|w| w.max(0.0)));
    let step = x.rows(0, size);
    // What φ depends on is accurate in u: small eigenvalues would drown in the residual of the other variables.
    let target = match problem.matrix {
        Matrix::Polynomial => {
            let form = x.rows(size + points, structure.hessian.keys).into_owned();
            Dual { weights, form, moments: &at.moments + &inverse * step }
        }
        Matrix::Hessian => {
            let form = &at.form + &inverse * step;
            Dual { moments: values * &weights - structure.pull_back(&form), weights, form }
        }
    };
    let predicted = problem.spectral.predicted(&measured, &problem.measured(&target)).ok_or(ProgramError::Singular)?;
    let hessian = match problem.matrix {
        Matrix::Polynomial => {
            let multiplier = unpacked(structure.hessian.size, &z.as_slice()[count + points..]);
            multiplier + DMatrix::identity(structure.hessian.size, structure.hessian.size) * problem.margin
        }
        Matrix::Hessian => predicted.gram,
    };
    Ok(Step {
        decrement: step.norm(),
        target,
        coefficients: z.rows(0, count).into_owned(),
        hessian,
        primal: predicted.value,
        full_accuracy,
        iterations,
    })
}

/// `½|u|² - slope·u` in `x = at + inverse u`.
struct Model<'a> {
    /// Monomials of the points, one column each.
    values: &'a DMatrix<f64>,
    at: &'a DVector<f64>,
    inverse: &'a DMatrix<f64>,
    slope: &'a DVector<f64>,
}

/// Variables u, w, s; rows `R⁻¹u - Σw v + D*s = -m0`, `w >= 0`, `S(s) ⪰ 0`. The multipliers of the first are the
/// coefficients of p, those of the last the matrix H - εI.
fn of_polynomial(problem: &Problem, model: &Model) -> Program {
    let structure = problem.structure;
    let (count, points) = (structure.monomials.len(), model.values.ncols());
    let cone = count + points;
    let mut columns = Columns::new(cone + packed_size(&structure.hessian));
    for i in 0..count {
        columns.push((0..=i).map(|row| (row, model.inverse[(row, i)])));
    }
    push_points(&mut columns, count, model.values);
    for (&(monomial, factor), entries) in structure.derivative.iter().zip(packed(&structure.hessian, cone)) {
        columns.push([(monomial, factor)].into_iter().chain(entries));
    }
    let mut linear: Vec<f64> = model.slope.iter().map(|v| -v).collect();
    linear.resize(cone, 1.0);
    let mut trace = vec![0.0; structure.hessian.keys];
    for i in 0..structure.hessian.size {
        trace[structure.hessian.key(i, i)] -= problem.margin;
    }
    linear.extend(trace);
    let mut right = vec![0.0; columns.rows];
    for (right, at) in right.iter_mut().zip(model.at) {
        *right = -at;
    }
    Program { quadratic: count, linear, columns, right, equalities: count, points, cones: vec![structure.hessian.size] }
}

/// Variables u, w, m; rows `D*R⁻¹u - Σw v + m = -D*s0`, `w >= 0`, `M(m) ⪰ 0`. The multipliers of the first are the
/// coefficients of p.
fn of_hessian(problem: &Problem, model: &Model) -> Program {
    let structure = problem.structure;
    let (count, forms, points) = (structure.monomials.len(), structure.hessian.keys, model.values.ncols());
    let cone = count + points;
    let mut columns = Columns::new(cone + packed_size(&structure.gram));
    for i in 0..forms {
        let pulled = structure.pull_back(&model.inverse.column(i).into_owned());
        columns.push(pulled.iter().copied().enumerate().collect::<Vec<_>>());
    }
    push_points(&mut columns, count, model.values);
    for (monomial, entries) in packed(&structure.gram, cone).into_iter().enumerate() {
        columns.push([(monomial, 1.0)].into_iter().chain(entries));
    }
    let mut linear: Vec<f64> = model.slope.iter().map(|v| -v).collect();
    linear.resize(forms + points, 1.0);
    linear.resize(forms + points + count, 0.0);
    let mut right = vec![0.0; columns.rows];
    for (right, at) in right.iter_mut().zip(&structure.pull_back(model.at)) {
        *right = -at;
    }
    Program { quadratic: forms, linear, columns, right, equalities: count, points, cones: vec![structure.gram.size] }
}

/// A column for each point: its monomials with a minus, and its sign constraint.
fn push_points(columns: &mut Columns, count: usize, values: &DMatrix<f64>) {
    for (i, value) in values.column_iter().enumerate() {
        columns.push(value.iter().map(|v| -v).enumerate().chain([(count + i, -1.0)]));
    }
}

/// The sign constraint of point `i`, whose rows come first.
pub(super) fn push_signs(i: usize) -> [(usize, f64); 1] {
    [(i, -1.0)]
}

/// Rows of a semidefinite cone.
pub(super) fn packed_size(pattern: &Pattern) -> usize {
    pattern.size * (pattern.size + 1) / 2
}

/// For each key of a pattern, its entries in the rows of a cone (upper triangle by columns, off-diagonals times √2) that
/// start at `row`, negated.
pub(super) fn packed(pattern: &Pattern, mut row: usize) -> Vec<Vec<(usize, f64)>> {
    let mut entries = vec![Vec::new(); pattern.keys];
    for j in 0..pattern.size {
        for i in 0..=j {
            entries[pattern.key(i, j)].push((row, if i == j { -1.0 } else { -SQRT_2 }));
            row += 1;
        }
    }
    entries
}

/// The symmetric matrix of the rows of a cone.
pub(super) fn unpacked(size: usize, rows: &[f64]) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(size, size);
    let mut row = 0;
    for j in 0..size {
        for i in 0..=j {
            let value = if i == j { rows[row] } else { rows[row] / SQRT_2 };
            matrix[(i, j)] = value;
            matrix[(j, i)] = value;
            row += 1;
        }
    }
    matrix
}

/// `minimise ½|x₁|² + linear·x` with x₁ the first `quadratic` variables, over equalities, signs and semidefinite cones.
pub(super) struct Program {
    pub(super) quadratic: usize,
    pub(super) linear: Vec<f64>,
    pub(super) columns: Columns,
    pub(super) right: Vec<f64>,
    pub(super) equalities: usize,
    pub(super) points: usize,
    pub(super) cones: Vec<usize>,
}

pub(super) struct Answer {
    pub(super) x: DVector<f64>,
    pub(super) z: DVector<f64>,
    pub(super) full_accuracy: bool,
    pub(super) iterations: u32,
}

impl Program {
    pub(super) fn solve(self, tolerance: f64) -> Result<Answer, ProgramError> {
        let (count, variables) = (self.quadratic, self.linear.len());
        let quadratic = CscMatrix::new(
            variables,
            variables,
            (0..=variables).map(|i| i.min(count)).collect(),
            (0..count).collect(),
            vec![1.0; count],
        );
        let mut cones = vec![SupportedConeT::NonnegativeConeT(self.points)];
        if self.equalities > 0 {
            cones.insert(0, SupportedConeT::ZeroConeT(self.equalities));
        }
        cones.extend(self.cones.iter().map(|&size| SupportedConeT::PSDTriangleConeT(size)));
        let matrix = self.columns.finish();
        let mut solver =
            DefaultSolver::new(&quadratic, &self.linear, &matrix, &self.right, &cones, settings(tolerance))
                .map_err(|error| ProgramError::Solver(error.to_string()))?;
        solver.solve();
        let solution = &solver.solution;
        let full_accuracy = match solution.status {
            SolverStatus::Solved => true,
            // Progress can end a little early; whoever uses the polynomial proves it first.
            SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress => false,
            other => return Err(ProgramError::Solver(format!("{other:?}"))),
        };
        Ok(Answer {
            x: DVector::from_column_slice(&solution.x),
            z: DVector::from_column_slice(&solution.z),
            full_accuracy,
            iterations: solution.iterations,
        })
    }
}

fn settings(tolerance: f64) -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_threads: 1,
        tol_gap_abs: tolerance,
        tol_gap_rel: tolerance,
        tol_feas: tolerance,
        direct_solve_method: "faer".to_string(),
        // One dense cone: there is nothing to decompose.
        chordal_decomposition_enable: false,
        ..DefaultSettings::default()
    }
}

/// A sparse matrix built column by column.
pub(super) struct Columns {
    rows: usize,
    starts: Vec<usize>,
    indices: Vec<usize>,
    values: Vec<f64>,
}

impl Columns {
    pub(super) fn new(rows: usize) -> Self {
        Self { rows, starts: vec![0], indices: Vec::new(), values: Vec::new() }
    }

    pub(super) fn push(&mut self, entries: impl IntoIterator<Item = (usize, f64)>) {
        for (row, value) in entries {
            self.indices.push(row);
            self.values.push(value);
        }
        self.starts.push(self.indices.len());
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    fn finish(self) -> CscMatrix<f64> {
        CscMatrix::new(self.rows, self.starts.len() - 1, self.starts, self.indices, self.values)
    }
}
