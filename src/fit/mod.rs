//! Points to a certified body: hull, whitening, semidefinite program, certificate, proof.
//!
//! The way of one fit: [`read`] the points; [`hull`] leaves those that matter; the smallest [`ellipsoid`] around them
//! gives the normalized frame; `generate` minimises an [`Objective`] over sos-convex polynomials with a margin by following
//! the central path of the dual (`path`); `refine` goes on to the volume itself; the constant coefficient pulls every input point inside; [`Body::new`] proves
//! the stored numbers. Nothing of that is believed: a fit returns a body only with its proofs.

mod barrier;
mod basis;
pub mod ellipsoid;
mod generate;
pub mod hull;
mod model;
mod objective;
mod path;
mod program;
mod progress;
pub mod read;
mod refine;
mod spectral;
mod structure;
mod volume;

pub use hull::HullError;
pub use objective::{Objective, UnknownObjective};
pub use program::ProgramError;
pub use progress::Progress;
pub use read::{ReadError, read_points};
pub use refine::RefinementEnd;

use crate::body::{Body, BodyError, Constraint, Normalization, NotContained, Placement, Provenance, check_name};
use crate::polynomial::{HessianGram, Polynomial, PolynomialError};
use basis::Affine;
use ellipsoid::{Ellipsoid, minimum_ellipsoid};
use generate::{Optimum, generate};
use hull::Frame;
use nalgebra::{Matrix3, Vector3};
use program::Problem;
use progress::Watch;
use refine::refine;
use std::ops::ControlFlow;
use std::time::Instant;
use structure::Structure;

/// Default of [`FitOptions::margin`].
pub const DEFAULT_MARGIN: f64 = 1e-5;

/// Factors on the margin for further attempts, when the certificate of a fit could not be proven.
const MARGIN_ATTEMPTS: [f64; 3] = [1.0, 10.0, 100.0];

/// What to fit.
#[derive(Clone, Debug, PartialEq)]
pub struct FitOptions {
    /// Degree of the polynomial: 2, 4, 6 or 8.
    pub degree: usize,
    /// What is minimised. Those of the Hessian's Gram matrix are offered up to degree 6.
    pub objective: Objective,
    /// Whether to minimise the volume itself, starting from the optimum of the objective.
    pub refine: bool,
    /// Smallest eigenvalue asked of the Gram matrix of the Hessian form in the whitened frame; in (0, 1e-2].
    ///
    /// It pays for the rounding of the certificate. Volumes grow by about a part in 10⁴ at 1e-4. The objectives of that very
    /// matrix keep it definite by themselves.
    pub margin: f64,
    /// Name of the input, for the provenance of the body.
    pub input: String,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self { degree: 6, objective: Objective::default(), refine: false, margin: DEFAULT_MARGIN, input: String::new() }
    }
}

impl FitOptions {
    /// Checks the options and the name of a body to be fitted, before any work.
    ///
    /// # Errors
    /// [`FitError::Degree`], [`FitError::Objective`], [`FitError::Margin`] or [`FitError::Name`].
    pub fn check(&self, name: &str) -> Result<(), FitError> {
        if ![2, 4, 6, 8].contains(&self.degree) {
            return Err(FitError::Degree(self.degree));
        }
        if self.degree > self.objective.max_degree() {
            return Err(FitError::Objective { objective: self.objective, degree: self.degree });
        }
        if !(self.margin > 0.0 && self.margin <= 1e-2) {
            return Err(FitError::Margin(self.margin));
        }
        check_name(name).map_err(FitError::Name)?;
        if self.input.is_empty() { Ok(()) } else { check_name(&self.input).map_err(FitError::Name) }
    }
}

/// What a fit took and reached.
#[derive(Clone, Debug, PartialEq)]
pub struct FitReport {
    /// Degree of the polynomial.
    pub degree: usize,
    /// Input points.
    pub points: usize,
    /// Vertices of their convex hull.
    pub hull_vertices: usize,
    /// Volume of the body, m³.
    pub volume_m3: f64,
    /// Estimate of the error of its quadrature, m³.
    pub volume_error_m3: f64,
    /// Volumes of the refinement before its first step and after each, m³, by the rule that it minimises; none without.
    pub refinement_m3: Vec<f64>,
    /// Volume of the convex hull, m³.
    pub hull_volume_m3: f64,
    /// Wall time, seconds.
    pub seconds: f64,
    /// Why the refinement ended; none without.
    pub refinement_end: Option<RefinementEnd>,
    /// [`FitReport::objective_value`] minus its lower bound from the dual; at most 1e-5 max(1, |value|).
    pub optimality_gap: f64,
    /// Programs solved, one per set of points and one per step of a refinement.
    pub rounds: usize,
    /// Newton steps of all of them.
    pub iterations: usize,
    /// What was minimised.
    pub objective: Objective,
    /// Its optimal value: log dets in the whitened frame, traces in the unit frame.
    pub objective_value: f64,
    /// Margin the certificate was proven with.
    pub margin: f64,
}

/// A fitted body and how it came about.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The body: proven sos-convex, bounded, and to contain every input point.
    pub body: Body,
    /// What it took.
    pub report: FitReport,
}

/// Why there is no fit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The degree is not one of 2, 4, 6, 8.
    #[error("degree: {0} is not one of 2, 4, 6, 8; bodies have even degree, 6 suits most objects")]
    Degree(usize),
    /// The objective is not offered at this degree.
    #[error("objective: {objective} is offered up to degree {}, not {degree}; take logdet-p or lower the degree",
        objective.max_degree())]
    Objective {
        /// The objective.
        objective: Objective,
        /// The degree.
        degree: usize,
    },
    /// The margin is outside its range.
    #[error("margin: {0} is not in (0, 0.01]; leave it at {DEFAULT_MARGIN:e} unless a certificate fails")]
    Margin(f64),
    /// Fewer than four points.
    #[error("points: {0} given; a body needs at least 4 that do not lie in one plane")]
    TooFewPoints(usize),
    /// A coordinate is not finite.
    #[error("points: point {0} (counted from 0) has a NaN or infinite coordinate; remove it or repair the mesh")]
    NotFinite(usize),
    /// The coordinates or their extent are beyond what any scene needs.
    #[error(
        "points: coordinates reach {0:.1e} m; between 1e-15 and 1e15 m can be fitted, change the units with the scale"
    )]
    OutOfRange(f64),
    /// A name that no body can have.
    #[error(transparent)]
    Name(BodyError),
    /// The points have no usable convex hull.
    #[error("points: {0}")]
    Hull(#[from] HullError),
    /// The progress callback asked to stop.
    #[error("the fit was cancelled")]
    Cancelled,
    /// The program has no usable start, or rounding ate it.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// Points were left outside again and again.
    #[error("points were still left outside after {rounds} rounds of adding them; lower the degree")]
    NoConvergence {
        /// Rounds done.
        rounds: usize,
    },
    /// The answer could not be verified optimal.
    #[error(
        "the fit is only known to be within {gap:.1e} of the optimal objective; lower the degree, or take the objective \
         logdet-p, which no frame makes worse"
    )]
    NotOptimal {
        /// Objective minus its lower bound from the dual.
        gap: f64,
    },
    /// The numbers make no polynomial.
    #[error("the fitted polynomial is unusable: {0}; lower the degree")]
    Polynomial(#[from] PolynomialError),
    /// The body could not be proven.
    #[error("the fitted polynomial could not be proven, also with a hundred times the margin: {0}; lower the degree")]
    Unproven(#[from] BodyError),
    /// A point could not be proven inside.
    #[error("the fitted polynomial could not be proven to contain the points: {0}; lower the degree")]
    NotContained(#[from] NotContained),
}

/// Fits a body of one polynomial around `points` (metres) with the least [`FitOptions::objective`].
///
/// Log dets are least in every affine frame at once. Traces depend on the frame: they are measured in the unit frame, in
/// which the points have their mean at the origin and largest norm 1.
///
/// `progress` hears of every Newton step (below a millisecond at degree 4 to tens of milliseconds at degree 8), those of a
/// refinement included, and can stop the fit.
///
/// # Errors
/// [`FitError`]: bad input by field, a cancelled fit, or what could not be solved or proven and by how much.
pub fn fit(
    name: &str,
    points: &[Vector3<f64>],
    options: &FitOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    let start = Instant::now();
    options.check(name)?;
    check(points)?;
    let hull = hull::convex_hull(points)?;
    let conditioned: Vec<Vector3<f64>> = hull.vertices.iter().map(|&i| hull.frame.apply(&points[i])).collect();
    let ellipsoid = minimum_ellipsoid(&conditioned).ok_or(ProgramError::Singular)?;
    let normalization = whitening(&hull.frame, &ellipsoid).ok_or(ProgramError::Singular)?;
    let whitened: Vec<Vector3<f64>> =
        hull.vertices.iter().map(|&i| normalization.linear * (points[i] - normalization.center)).collect();
    let structure = Structure::new(options.degree);
    let unit = unit_frame(points, &normalization).ok_or(ProgramError::Singular)?;

    let mut attempts = MARGIN_ATTEMPTS.iter().map(|factor| factor * options.margin);
    let mut watch = Watch::new(progress);
    let (body, optimum, margin, volumes, refinement_end) = loop {
        let margin = attempts.next().unwrap_or(options.margin);
        let problem = Problem::new(&structure, options.objective, &unit, margin);
        let mut optimum = generate(problem, &whitened, &mut watch)?;
        let (mut volumes, mut end) = (Vec::new(), None);
        if options.refine {
            let (coefficients, hessian) = (optimum.coefficients.clone(), optimum.hessian.clone());
            let refined = refine(&structure, &whitened, margin, coefficients, hessian, &mut watch)?;
            (optimum.coefficients, optimum.hessian) = (refined.coefficients, refined.hessian);
            (volumes, end) = (refined.volumes, Some(refined.end));
        }
        match certify(name, points, &normalization, &structure, &optimum) {
            Ok(body) => break (body, optimum, margin, volumes, end),
            Err(FitError::Unproven(BodyError::Certificate { .. })) if attempts.len() > 0 => {}
            Err(error) => return Err(error),
        }
    };
    let body = body.with_provenance(Provenance {
        input: options.input.clone(),
        objective: options.objective.name().to_owned(),
        refined: volumes.len() > 1,
        hull_vertices: hull.vertices.len(),
        hull_volume_m3: hull.volume,
    });
    let report = FitReport {
        degree: options.degree,
        points: points.len(),
        hull_vertices: hull.vertices.len(),
        volume_m3: body.volume().volume_m3,
        volume_error_m3: body.volume().error_m3,
        refinement_m3: volumes.iter().map(|volume| volume / normalization.linear.determinant().abs()).collect(),
        hull_volume_m3: hull.volume,
        seconds: start.elapsed().as_secs_f64(),
        refinement_end,
        objective: options.objective,
        objective_value: optimum.objective,
        optimality_gap: optimum.gap,
        rounds: watch.progress().round,
        iterations: watch.progress().iterations,
        margin,
    };
    Ok(Fit { body, report })
}

/// The map from the frame of the points to that of the ellipsoid around the conditioned points, with orthogonal rows: such a
/// map amplifies no rounding, however long the ellipsoid is.
fn whitening(frame: &Frame, ellipsoid: &Ellipsoid) -> Option<Normalization> {
    let center = frame.center + frame.linear.try_inverse()? * ellipsoid.center;
    let decomposition = (ellipsoid.linear * frame.linear).svd(false, true);
    let mut turn = decomposition.v_t?;
    if turn.determinant() < 0.0 {
        turn.row_mut(2).neg_mut();
    }
    Some(Normalization { center, linear: Matrix3::from_diagonal(&decomposition.singular_values) * turn })
}

/// The map from the whitened frame to the unit frame.
fn unit_frame(points: &[Vector3<f64>], whitened: &Normalization) -> Option<Affine> {
    let count = points.len() as f64;
    // About the center, which is near: far-off coordinates would round the mean away.
    let offset = points.iter().map(|p| (p - whitened.center) / count).sum::<Vector3<f64>>();
    let reach = points.iter().map(|p| (p - whitened.center - offset).norm()).fold(0.0, f64::max);
    Some(Affine { linear: whitened.linear.try_inverse()? / reach, offset: -offset / reach })
}

fn check(points: &[Vector3<f64>]) -> Result<(), FitError> {
    if points.len() < 4 {
        return Err(FitError::TooFewPoints(points.len()));
    }
    if let Some(index) = points.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
        return Err(FitError::NotFinite(index));
    }
    let reach = points.iter().map(Vector3::amax).fold(0.0, f64::max);
    // Coinciding points at the origin are told as such later.
    if reach > 1e15 || reach > 0.0 && reach < 1e-15 { Err(FitError::OutOfRange(reach)) } else { Ok(()) }
}

/// Pulls all points inside by the constant coefficient, which leaves the Hessian as it is, and proves the body.
fn certify(
    name: &str,
    points: &[Vector3<f64>],
    normalization: &Normalization,
    structure: &Structure,
    optimum: &Optimum,
) -> Result<Body, FitError> {
    let terms = structure.monomials.iter().copied().zip(optimum.coefficients.iter().copied()).collect();
    let polynomial = Polynomial::new(terms)?;
    let gram = HessianGram::nearest(&polynomial, structure.hessian_basis.clone(), optimum.hessian.clone())
        .map_err(|source| BodyError::Certificate { index: 0, source })?;
    let mut constraint = Constraint { polynomial, gram };
    let inverse = normalization.linear.try_inverse().ok_or(ProgramError::Singular)?;
    let placement = Placement::new(normalization.linear, inverse, normalization.center, 0.0, 0.0);
    // The bound of the rounding moves a little with the constant: a second pass settles it.
    for _ in 0..3 {
        let highest =
            points.iter().map(|x| placement.sample(&constraint, x).value_upper(0.0)).fold(f64::NEG_INFINITY, f64::max);
        let excess = highest - 1.0;
        if (-1e-15..=0.0).contains(&excess) {
            break;
        }
        constraint.polynomial = constraint.polynomial.with_constant_shifted(-(excess + 4.0 * f64::EPSILON));
    }
    Ok(Body::new(name, *normalization, vec![constraint])?.with_points(points)?)
}

#[cfg(test)]
mod tests;
