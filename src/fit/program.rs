//! The semidefinite program of one fit, as a sequence of quadratic ones that clarabel solves.
//!
//! The paper's program (its section III, convex case) in the whitened frame, with a margin ε:
//!
//! ```text
//! minimise  -log det P   subject to  p = zᵀPz,  yᵀ∇²p y = wᵀHw,  H ⪰ εI,  p(xᵢ) <= 1
//! ```
//!
//! Its dual has far fewer variables: weights w >= 0 of the points and a functional s on the Hessian form, and
//!
//! ```text
//! minimise  -log det M(m) + Σwᵢ - ε tr S(s)   subject to  m = Σ wᵢ v(xᵢ) - D*s,  S(s) ⪰ 0,  w >= 0
//! ```
//!
//! where M and S are (pseudo-)moment matrices, v the monomials of p and D the map from p to its Hessian form. At the
//! optimum P = M⁻¹. `-log det` is self-concordant, so damped Newton steps converge from any positive definite M, and a
//! Newton step is a quadratic program over one small semidefinite cone: no exponential cones and no 2N block for the
//! determinant. The multipliers of each such program are a polynomial p and a Gram matrix H that satisfy **all**
//! constraints of the paper's program for the points used, however far the Newton iteration still has to go.

use super::structure::Structure;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{Cholesky, DMatrix, DVector};
// Links the BLAS that clarabel's semidefinite cones call.
use openblas_src as _;

/// Why a program could not be solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ProgramError {
    /// The solver refused or gave up.
    #[error("the semidefinite solver stopped with {0}; lower the degree")]
    Solver(String),
    /// A moment matrix lost its definiteness.
    #[error("the points do not span the polynomials of this degree numerically; lower the degree")]
    Singular,
}

/// A dual point: weights, functional on the Hessian form, and the moments they give.
#[derive(Clone, Debug)]
pub(super) struct Dual {
    /// One weight per point of the program.
    pub(super) weights: DVector<f64>,
    /// Functional s on the Hessian form.
    pub(super) form: DVector<f64>,
    /// Moments m.
    pub(super) moments: DVector<f64>,
}

/// What one quadratic program gives.
#[derive(Clone, Debug)]
pub(super) struct Step {
    /// The minimiser of the quadratic model.
    pub(super) target: Dual,
    /// Coefficients of p, feasible for the points of the program.
    pub(super) coefficients: DVector<f64>,
    /// Gram matrix of its Hessian form, `⪰ εI`.
    pub(super) hessian: DMatrix<f64>,
    /// Newton decrement: distance to the target in the local norm of -log det.
    pub(super) decrement: f64,
    /// `-log det` of the Gram matrix of p, if that is positive definite.
    pub(super) primal: Option<f64>,
    /// Solved to full accuracy (not only "almost").
    pub(super) full_accuracy: bool,
    /// Interior-point iterations.
    pub(super) iterations: u32,
}

/// The dual objective, as the lower bound of the primal: `log det M + N - Σw + ε tr S`.
pub(super) fn lower_bound(structure: &Structure, dual: &Dual, margin: f64) -> Result<f64, ProgramError> {
    let n = structure.gram.size as f64;
    Ok(log_det(&structure.gram.spread(&dual.moments)).ok_or(ProgramError::Singular)? + n - dual.weights.sum()
        + margin * structure.hessian.trace(&dual.form))
}

/// `log det` of a positive definite matrix.
pub(super) fn log_det(matrix: &DMatrix<f64>) -> Option<f64> {
    let factor = Cholesky::new(matrix.clone())?;
    let value = 2.0 * factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    value.is_finite().then_some(value)
}

/// Minimises the quadratic model of the dual at moments `at`, over the points whose monomials are the columns of
/// `values`, to the solver's tolerance `tolerance`.
pub(super) fn newton_step(
    structure: &Structure,
    values: &DMatrix<f64>,
    margin: f64,
    at: &DVector<f64>,
    tolerance: f64,
) -> Result<Step, ProgramError> {
    let (count, points, forms) = (structure.monomials.len(), values.ncols(), structure.hessian.keys);
    let gram = Cholesky::new(structure.gram.spread(at)).ok_or(ProgramError::Singular)?.inverse();
    let gradient = structure.gram.collapse(&gram);
    let curvature = structure.gram.congruence(&gram);
    // In the coordinates u = R m, curvature = RᵀR, the model is perfectly conditioned. The rows stay those of m, where D
    // has one entry per column: that keeps the factorization sparse.
    let lower = regularised_factor(&curvature).ok_or(ProgramError::Singular)?;
    let whitened_gradient = lower.solve_lower_triangular(&gradient).ok_or(ProgramError::Singular)?;
    let upper = lower.transpose();
    let whitened_at = &upper * at;
    let inverse = upper.solve_upper_triangular(&DMatrix::identity(count, count)).ok_or(ProgramError::Singular)?;

    let h = structure.hessian.size;
    let mut columns = Columns::new(count + points + h * (h + 1) / 2);
    for i in 0..count {
        columns.push((0..=i).map(|row| (row, inverse[(row, i)])));
    }
    for i in 0..points {
        columns.push(values.column(i).iter().map(|v| -v).enumerate().chain([(count + i, -1.0)]));
    }
    let cone = count + points;
    let mut entries = vec![Vec::new(); forms];
    let mut row = cone;
    for j in 0..h {
        for i in 0..=j {
            let scale = if i == j { 1.0 } else { std::f64::consts::SQRT_2 };
            entries[structure.hessian.key(i, j)].push((row, -scale));
            row += 1;
        }
    }
    for (&(monomial, scale), entries) in structure.derivative.iter().zip(entries) {
        columns.push([(monomial, scale)].into_iter().chain(entries));
    }

    let variables = count + points + forms;
    let mut linear = vec![0.0; variables];
    for i in 0..count {
        linear[i] = -whitened_gradient[i] - whitened_at[i];
    }
    linear[count..cone].fill(1.0);
    for i in 0..h {
        linear[cone + structure.hessian.key(i, i)] -= margin;
    }
    let quadratic = CscMatrix::new(
        variables,
        variables,
        (0..=variables).map(|i| i.min(count)).collect(),
        (0..count).collect(),
        vec![1.0; count],
    );
    let cones = [
        SupportedConeT::ZeroConeT(count),
        SupportedConeT::NonnegativeConeT(points),
        SupportedConeT::PSDTriangleConeT(h),
    ];
    let matrix = columns.finish();
    let rows = matrix.m;
    let mut solver = DefaultSolver::new(&quadratic, &linear, &matrix, &vec![0.0; rows], &cones, settings(tolerance))
        .map_err(|error| ProgramError::Solver(error.to_string()))?;
    solver.solve();
    let solution = &solver.solution;
    let full_accuracy = match solution.status {
        SolverStatus::Solved => true,
        // Progress can end a little early; whoever uses the polynomial proves it first.
        SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress => false,
        other => return Err(ProgramError::Solver(format!("{other:?}"))),
    };

    let weights = DVector::from_iterator(points, solution.x[count..cone].iter().map(|w| w.max(0.0)));
    let form = DVector::from_column_slice(&solution.x[cone..]);
    let moments = values * &weights - structure.pull_back(&form);
    let coefficients = DVector::from_column_slice(&solution.z[..count]);
    let mut hessian = DMatrix::zeros(h, h);
    let mut row = cone;
    for j in 0..h {
        for i in 0..=j {
            let value = if i == j { solution.z[row] + margin } else { solution.z[row] / std::f64::consts::SQRT_2 };
            hessian[(i, j)] = value;
            hessian[(j, i)] = value;
            row += 1;
        }
    }
    let decrement = (&upper * (&moments - at)).norm();
    // The Gram matrix the model predicts: its coefficients are those of p.
    let predicted = &gram * 2.0 - &gram * structure.gram.spread(&moments) * &gram;
    Ok(Step {
        target: Dual { weights, form, moments },
        coefficients,
        hessian,
        decrement,
        primal: log_det(&predicted).map(|value| -value),
        full_accuracy,
        iterations: solution.iterations,
    })
}

/// Lower Cholesky factor of a matrix that is positive definite up to rounding: its diagonal grows until it is. A slightly
/// wrong curvature changes the path of the Newton steps, not where they end.
pub(super) fn regularised_factor(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    [0.0, 1e-14, 1e-12, 1e-10, 1e-8].into_iter().find_map(|share| {
        let mut matrix = matrix.clone();
        for i in 0..matrix.nrows() {
            matrix[(i, i)] *= 1.0 + share;
        }
        Some(Cholesky::new(matrix)?.unpack()).filter(|factor| factor.iter().all(|v| v.is_finite()))
    })
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
struct Columns {
    rows: usize,
    starts: Vec<usize>,
    indices: Vec<usize>,
    values: Vec<f64>,
}

impl Columns {
    fn new(rows: usize) -> Self {
        Self { rows, starts: vec![0], indices: Vec::new(), values: Vec::new() }
    }

    fn push(&mut self, entries: impl IntoIterator<Item = (usize, f64)>) {
        for (row, value) in entries {
            self.indices.push(row);
            self.values.push(value);
        }
        self.starts.push(self.indices.len());
    }

    fn finish(self) -> CscMatrix<f64> {
        CscMatrix::new(self.rows, self.starts.len() - 1, self.starts, self.indices, self.values)
    }
}
