//! Fits over the smaller cones: down in the volume itself, from the smallest ellipsoid.
//!
//! No log det stands in for the volume here, since that would take a semidefinite cone. Each step
//! minimises a convex quadratic model of the volume (`volume`) over the cone and around some of the
//! points, and moves towards it as long as the volume falls when the constant coefficient takes in
//! all points. So the volume never grows, and what had to be taken in is known to the next step.

use super::Cone;
use super::conic_program::{ConicProgram, Expression, solve};
use super::dominance::Dominance;
use super::farthest_points::farthest_points;
use super::model::Model;
use super::path::Interior;
use super::progress::Watch;
use super::refine::{Refined, RefinementEnd, normalise, step_model};
use super::spaced_points::spaced_points;
use super::structure::Structure;
use super::unsolved::{Failure, Fault, ProgramError, Unsolved};
use super::volume::{expansion, polynomial, volume};
use super::{FitError, Solver};
use nalgebra::{DMatrix, DVector, Vector3};

/// Steps at most; 5 to 10 are usual.
const MAX_VOLUME_STEPS: usize = 30;

/// Relative decrease of the volume below which a descent ends; dimensionless.
///
/// A hundred times that of a refinement: the smaller cones are for speed. A larger value leaves
/// bodies visibly too large; a smaller one takes most of the time for the last steps. Pinned by
/// `degree_two_over_any_cone_is_the_smallest_ellipsoid`.
const CONE_VOLUME_DECREASE: f64 = 2e-3;

/// Tolerance asked of the solver; dimensionless.
///
/// A larger value leaves residuals that cost certificates; a smaller one takes more iterations.
/// Pinned by `programs_agree_with_another_statement`.
const TOLERANCE: f64 = 1e-8;
/// Points that the first program knows, in multiples of the rows of P, and at most as many more in
/// each of the next.
const KNOWN_MULTIPLE: usize = 4;

/// Excess of p - 1 from which a point is made known to the next program; dimensionless.
///
/// What is less costs less volume than [`CONE_VOLUME_DECREASE`]. A larger value leaves that volume
/// to the shift of the constant; a smaller one fills the program with points that bound alike.
/// Pinned by `degree_two_over_any_cone_is_the_smallest_ellipsoid`.
const OUTSIDE: f64 = 1e-4;
/// Residual of the Hessian form, relative to its Gram matrix, that a certificate can make up for.
const FORM_RESIDUAL: f64 = 1e-6;
/// Lengths tried of one step.
const LENGTHS: usize = 8;

/// The polynomial of about the least volume over the cone with `p <= 1` at `points` (whitened: the
/// unit ball is their smallest ellipsoid) whose Gram matrix is in the cone also without `margin` on
/// its diagonal.
pub(super) fn descend(
    structure: &Structure,
    cone: Cone,
    points: &[Vector3<f64>],
    margin: f64,
    watch: &mut Watch,
) -> Result<Refined, FitError> {
    let dominance = Dominance::new(structure, cone);
    let values = DMatrix::from_columns(&points.iter().map(|x| structure.values(x)).collect::<Vec<_>>());
    let mut known = Known::start(points, KNOWN_MULTIPLE * structure.gram.size);
    let rows = structure.hessian.size;
    let mut current = Interior { coefficients: ball(structure), hessian: DMatrix::zeros(rows, rows) };
    let mut volumes: Vec<f64> = Vec::new();
    let mut center = Vector3::zeros();
    let mut end = RefinementEnd::StepLimit;
    for _ in 0..MAX_VOLUME_STEPS {
        center = normalise(structure, &mut current, &center)?;
        let p = polynomial(structure, &current.coefficients)?;
        let expansion = expansion(structure, &p, &center);
        let here = expansion.volume;
        let model = step_model(structure, &current.coefficients, expansion, &center).ok_or(ProgramError::Singular)?;
        let columns = values.select_columns(&known.indices);
        let program = ModelProgram { dominance: &dominance, structure, values: &columns, margin, model: &model };
        watch.round(columns.ncols(), known.worst);
        let target = match program.minimise(here, watch)? {
            Ok(target) => target,
            // Nothing has a Gram matrix yet.
            Err(why) if volumes.is_empty() => {
                let failure = Failure { solver: Solver::Clarabel, points: columns.ncols(), why };
                let (degree, failures) = (structure.degree, vec![failure]);
                return Err(FitError::Unsolved(Unsolved { degree, failures, is_solver_fixed: false }));
            }
            Err(_) => {
                end = RefinementEnd::Unsolved;
                break;
            }
        };
        known.learn(points, &values, &target.coefficients);
        // The ball has no Gram matrix of its own: the first step is taken whole, whatever its
        // volume.
        let (lengths, bar) = if volumes.is_empty() { (1, f64::INFINITY) } else { (LENGTHS, here) };
        let line = LineSearch { structure, values: &values, center: &center, lengths, bar };
        let Some((found, there)) = line.run(&current, &target) else {
            end = RefinementEnd::NoDescent;
            break;
        };
        current = found;
        volumes.push(there);
        if there > (1.0 - CONE_VOLUME_DECREASE) * bar {
            end = RefinementEnd::Converged;
            break;
        }
    }
    if volumes.is_empty() {
        return Err(ProgramError::Singular.into());
    }
    Ok(Refined { coefficients: current.coefficients, hessian: current.hessian, volumes, end })
}

/// A convex quadratic model of the coefficients c of p, to be minimised over one of the smaller
/// cones:
///
/// ```text
/// minimise  F(c)   subject to  p(xᵢ) <= 1,   D c - ε tr = the form of blocks in their cones
/// ```
pub(super) struct ModelProgram<'a> {
    pub(super) dominance: &'a Dominance<'a>,
    pub(super) structure: &'a Structure,
    /// Monomials of each point, one column each.
    pub(super) values: &'a DMatrix<f64>,
    /// ε.
    pub(super) margin: f64,
    /// F.
    pub(super) model: &'a Model,
}

impl ModelProgram<'_> {
    /// The minimiser, progress in units of `unit`; why not where the solver has none that matches
    /// the Hessian form.
    ///
    /// # Errors
    /// [`FitError::Cancelled`].
    pub(super) fn minimise(&self, unit: f64, watch: &mut Watch) -> Result<Result<Interior, ProgramError>, FitError> {
        let Self { dominance, structure, values, margin, model } = *self;
        let pattern = &structure.hessian;
        let mut program = ConicProgram::default();
        let coefficients = program.variables(structure.monomials.len());
        let (linear, quadratic) = model.terms();
        coefficients.clone().zip(linear.iter()).for_each(|(variable, &cost)| program.add_cost(variable, cost));
        program.add_quadratic(coefficients.start, quadratic);
        program.nonnegative(values.column_iter().map(|values| {
            let terms = coefficients.clone().zip(values.iter().map(|value| -value)).collect();
            Expression { terms, constant: 1.0 }
        }));
        let of_key =
            |&(monomial, factor): &(usize, f64)| Expression::default().plus(factor, coefficients.start + monomial);
        let mut form: Vec<Expression> = structure.derivative.iter().map(of_key).collect();
        (0..pattern.size).for_each(|i| form[pattern.key(i, i)].constant -= margin);
        let blocks = dominance.constrain(&mut program, form);
        let solution = match solve(&program, TOLERANCE, unit, watch) {
            Ok(solution) => solution,
            Err(FitError::Program(why)) => return Ok(Err(why)),
            Err(error) => return Err(error),
        };
        let coefficients = solution.values(coefficients);
        let hessian = dominance.gram(&blocks, &solution) + DMatrix::identity(pattern.size, pattern.size) * margin;
        let residual = (structure.derivative_matrix() * &coefficients - pattern.collapse(&hessian)).amax();
        if !(residual <= FORM_RESIDUAL * hessian.amax().max(1.0)) {
            let (stop, fault) = (solution.stop, Fault::Residual(residual));
            return Ok(Err(ProgramError::Unusable { stop, fault }));
        }
        Ok(Ok(Interior { coefficients, hessian }))
    }
}

/// A search along a segment of polynomials for one of about the smallest volume.
struct LineSearch<'a> {
    structure: &'a Structure,
    /// Monomials of each point, one column each.
    values: &'a DMatrix<f64>,
    /// A point inside, from which volumes are measured.
    center: &'a Vector3<f64>,
    /// Lengths tried.
    lengths: usize,
    /// Volume that must be undercut.
    bar: f64,
}

impl LineSearch<'_> {
    /// The polynomial between `from` and `to` with about the smallest volume around all points, and
    /// that volume; none if no trial has a volume below the bar.
    fn run(&self, from: &Interior, to: &Interior) -> Option<(Interior, f64)> {
        let Self { structure, values, center, .. } = *self;
        let at = |t: f64| {
            let mut coefficients = &from.coefficients + (&to.coefficients - &from.coefficients) * t;
            coefficients[0] += 1.0 - values.tr_mul(&coefficients).max();
            coefficients
        };
        let mut best = (None, self.bar);
        let mut length = 1.0;
        for _ in 0..self.lengths {
            let coefficients = at(length);
            let value = polynomial(structure, &coefficients).map_or(f64::INFINITY, |p| volume(&p, center));
            if value < best.1 {
                let hessian = &from.hessian + (&to.hessian - &from.hessian) * length;
                best = (Some(Interior { coefficients, hessian }), value);
            } else if best.0.is_some() {
                break;
            }
            length *= 0.6;
        }
        Some((best.0?, best.1))
    }
}

/// The unit ball as the set of a polynomial of full degree: the mean of `|z|²ʲ`, j from 1 to half
/// the degree.
fn ball(structure: &Structure) -> DVector<f64> {
    let factorial = |n: u8| (1..=n).map(f64::from).product::<f64>();
    let half = (structure.degree / 2) as f64;
    let of_monomial = structure.monomials.iter().map(|e| {
        let total: u8 = e.iter().sum();
        if total == 0 || e.iter().any(|n| n % 2 == 1) {
            return 0.0;
        }
        factorial(total / 2) / e.iter().map(|n| factorial(n / 2)).product::<f64>() / half
    });
    DVector::from_iterator(structure.monomials.len(), of_monomial)
}

/// Which of the points the programs know.
struct Known {
    indices: Vec<usize>,
    /// Most points to learn at a time.
    most: usize,
    /// Largest p - 1 of the last optimum over all points, at least 0.
    worst: f64,
}

impl Known {
    /// So many of the points, each the farthest from those before it.
    fn start(points: &[Vector3<f64>], most: usize) -> Self {
        Self { indices: farthest_points(points, most), most, worst: 0.0 }
    }

    /// Adds those that were left outside the farthest, but not many from one spot.
    fn learn(&mut self, points: &[Vector3<f64>], values: &DMatrix<f64>, coefficients: &DVector<f64>) {
        let excess = values.tr_mul(coefficients).add_scalar(-1.0);
        let mut outside: Vec<usize> = (0..points.len()).filter(|&i| excess[i] > OUTSIDE).collect();
        outside.sort_by(|&i, &j| excess[j].total_cmp(&excess[i]));
        self.worst = excess.max().max(0.0);
        self.indices.extend(spaced_points(points, outside, self.most));
    }
}
