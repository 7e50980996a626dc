//! Fits over the smaller cones: down in the volume itself, from the smallest ellipsoid.
//!
//! No log det stands in for the volume here, since that would take a semidefinite cone. Each step
//! minimises a convex quadratic model of the volume (`volume`) over the cone and around some of the
//! points, and moves towards it as long as the volume falls when the constant coefficient takes in
//! all points. So the volume never grows, and what had to be taken in is known to the next step.

use super::Cone;
use super::conic::Conic;
use super::dominance::Dominance;
use super::farthest_points::farthest_points;
use super::path::Interior;
use super::progress::Watch;
use super::refine::{Refined, RefinementEnd, normalise, step_model};
use super::spaced_points::spaced_points;
use super::structure::Structure;
use super::volume::{expansion, polynomial, volume};
use super::{FitError, ProgramError};
use nalgebra::{DMatrix, DVector, Vector3};

/// Steps at most; 5 to 10 are usual.
const MAX_VOLUME_STEPS: usize = 30;

/// Relative decrease of the volume below which a descent ends; dimensionless.
///
/// A hundred times that of a refinement: the smaller cones are for speed. A larger value leaves
/// bodies visibly too large; a smaller one takes most of the time for the last steps. Pinned by
/// `degree_two_over_any_cone_is_the_smallest_ellipsoid`.
const CONE_VOLUME_DECREASE: f64 = 2e-3;

/// Accuracy of a step's program, relative to the volume; dimensionless.
///
/// A twentieth of [`CONE_VOLUME_DECREASE`], so that a step's decrease is not its error. A larger
/// value ends descents early; a smaller one takes more Newton steps. The search along each step
/// hides its effect on volumes, and no test fixes it.
const CONE_STEP_GAP: f64 = 1e-4;
/// Points that the first program knows, in multiples of the rows of P, and at most as many more in
/// each of the next.
const KNOWN_MULTIPLE: usize = 4;

/// Excess of p - 1 from which a point is made known to the next program; dimensionless.
///
/// What is less costs less volume than [`CONE_VOLUME_DECREASE`]. A larger value leaves that volume
/// to the shift of the constant; a smaller one fills the program with points that bound alike.
/// Pinned by `degree_two_over_any_cone_is_the_smallest_ellipsoid`.
const OUTSIDE: f64 = 1e-4;
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
        let program = Conic { dominance: &dominance, values: &columns, margin, model: &model };
        watch.round(columns.ncols(), known.worst);
        let target = program.minimise(&current.coefficients, CONE_STEP_GAP * here, watch)?;
        let Some(target) = target else {
            end = RefinementEnd::Unsolved;
            break;
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
