//! Points to a set that need not be convex, with its proofs.
//!
//! Two methods: the program of a body with convexity relaxed, `p + c |u|^2d` sos-convex in place of
//! p (Ahmadi, Hall, Makadia and Sindhwani, RSS 2017, section III), and the inverse-moment
//! polynomial (`moment`). Points between others matter as much as these, so all are used.

use super::coordinates::Coordinates;
use super::generate::{Optimum, generate};
use super::margin::{DEFAULT_MARGIN, MARGIN_ATTEMPTS};
use super::moment::{inverse_moment, moments};
use super::object::{Object, pulled_inside};
use super::objective::{Matrix, Measure};
use super::program::Problem;
use super::progress::{Progress, Watch};
use super::structure::Structure;
use super::{FitError, FitOptions, Objective, ProgramError};
use nalgebra::{DMatrix, DVector, Vector3};
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::body::{Placement, Provenance, Relaxation, Solver, SolverStep, SosBody, SosBodyError, SosMethod};
use sublevel_core::polynomial::{HessianGram, NormPower, Polynomial, SosGram, monomials};

/// How far below 1 all points are left: that is what lets triangles at the outermost points be
/// proven inside.
const SLACK_BELOW_LEVEL: f64 = 1e-9;

/// What to fit.
#[derive(Clone, Debug, PartialEq)]
pub struct SosOptions {
    /// Degree of the polynomial: 2, 4, 6 or 8.
    pub degree: usize,
    /// How.
    pub method: SosMethod,
    /// Coordinates u that c refers to, and in which traces are measured.
    pub coordinates: Coordinates,
    /// What solves the program of [`SosMethod::Relaxed`], as [`FitOptions::solver`].
    pub solver: Option<Solver>,
    /// Name of the input, for the provenance of the set.
    pub input: String,
}

/// What a fit took and reached.
#[derive(Clone, Debug, PartialEq)]
pub struct SosReport {
    /// Input points.
    pub points: usize,
    /// Vertices of their convex hull.
    pub hull_vertices: usize,
    /// Volume of the convex hull, m³; the set may be smaller.
    pub hull_volume_m3: f64,
    /// Wall time, seconds.
    pub seconds: f64,
    /// What the program took; none for the inverse moment.
    pub program: Option<ProgramReport>,
}

/// What a program took and reached.
#[derive(Clone, Debug, PartialEq)]
pub struct ProgramReport {
    /// Optimal value: log dets in the whitened frame, traces in the chosen coordinates.
    pub objective_value: f64,
    /// That minus its lower bound from the dual; at most 1e-5 max(1, |value|).
    pub optimality_gap: f64,
    /// Programs solved.
    pub rounds: usize,
    /// Iterations of all of them.
    pub iterations: usize,
    /// Margin the certificate of the relaxation was proven with.
    pub margin: f64,
    /// What solved it.
    pub solver: Solver,
    /// Why the solver that was tried first did not, if one was.
    pub fallback: Option<String>,
    /// The iterations of the conic solver, of all programs.
    pub log: Vec<SolverStep>,
}

/// A fitted set and how it came about.
#[derive(Clone, Debug)]
pub struct SosFit {
    /// The set: proven to be of a sum of squares, bounded, and to contain every input point.
    pub body: SosBody,
    /// What it took.
    pub report: SosReport,
}

impl SosOptions {
    /// Checks the options and the name of a set to be fitted, before any work.
    ///
    /// # Errors
    /// [`FitError::Degree`], [`FitError::Relaxation`], [`FitError::RelaxedObjective`] or
    /// [`FitError::Name`].
    pub fn check(&self, name: &str) -> Result<(), FitError> {
        let objective = match self.method {
            SosMethod::Relaxed { c, .. } if !(c > 0.0) => return Err(FitError::Relaxation(c)),
            SosMethod::Relaxed { objective, .. } if objective.matrix() == Matrix::Hessian => {
                return Err(FitError::RelaxedObjective(objective));
            }
            SosMethod::Relaxed { objective, .. } => objective,
            SosMethod::InverseMoment => Objective::default(),
        };
        let (degree, solver, input) = (self.degree, self.solver, self.input.clone());
        FitOptions { degree, objective, solver, input, ..FitOptions::default() }.check(name)
    }
}

/// Fits an sos-body around `points` (metres), and proves which of the `triangles` between them it
/// contains.
///
/// The points end a billionth below the level 1. `progress` is called at every iteration and can
/// stop the fit; an inverse moment has none.
///
/// # Errors
/// [`FitError`]: bad input by field, a cancelled fit, or what could not be solved or proven and by
/// how much.
pub fn fit_sos(
    name: &str,
    points: &[Vector3<f64>],
    triangles: &[[usize; 3]],
    options: &SosOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<SosFit, FitError> {
    let start = Instant::now();
    options.check(name)?;
    let object = Object::new(name, points, &options.input)?;
    let whitened: Vec<_> = points.iter().map(|x| object.whiten(x)).collect();
    let (body, program) = match options.method {
        SosMethod::Relaxed { c, objective } => {
            let relaxed = RelaxedProgram { object: &object, whitened: &whitened, options, c, objective };
            let (body, program) = relaxed.solve(&mut Watch::new(progress))?;
            (body, Some(program))
        }
        SosMethod::InverseMoment => {
            let structure = Structure::without_convexity(options.degree);
            let gram = inverse_moment(&structure, &whitened)?;
            let coefficients = structure.gram.collapse(&gram);
            (certify(&object, &structure, &coefficients, gram, |_| Ok(None))?, None)
        }
    };
    let hull = object.hull();
    let mut body = body.with_provenance(Provenance {
        input: options.input.clone(),
        objective: options.method.name().to_owned(),
        refined: false,
        hull_vertices: hull.vertices.len(),
        hull_volume_m3: hull.volume,
        solver: program.as_ref().map(|program| program.solver),
    });
    if !triangles.is_empty() {
        let coverage = body.coverage(points, triangles)?;
        body = body.with_coverage(coverage);
    }
    let report = SosReport {
        points: points.len(),
        hull_vertices: hull.vertices.len(),
        hull_volume_m3: hull.volume,
        seconds: start.elapsed().as_secs_f64(),
        program,
    };
    Ok(SosFit { body, report })
}

/// The program of a set with relaxed convexity.
struct RelaxedProgram<'a> {
    object: &'a Object<'a>,
    /// All points, whitened.
    whitened: &'a [Vector3<f64>],
    options: &'a SosOptions,
    /// See [`SosMethod::Relaxed`].
    c: f64,
    objective: Objective,
}

impl RelaxedProgram<'_> {
    /// The set with the least objective. Without a bound of convexity only the points keep p from
    /// growing.
    fn solve(&self, watch: &mut Watch) -> Result<(SosBody, ProgramReport), FitError> {
        let Self { object, whitened, options, c, objective } = *self;
        let map = object.coordinates(options.coordinates)?;
        let structure = if c.is_finite() {
            Structure::new(options.degree)
        } else {
            let structure = Structure::without_convexity(options.degree);
            moments(&structure, whitened)?;
            structure
        };
        let power = c.is_finite().then(|| NormPower::new(c, &map.linear, &map.offset, options.degree));
        let mut margins = MARGIN_ATTEMPTS.iter().map(|factor| factor * DEFAULT_MARGIN);
        loop {
            let margin = margins.next().unwrap_or(DEFAULT_MARGIN);
            let problem =
                Problem::new(&structure, objective, &map, margin).relaxed(power.as_ref()).solved_by(options.solver);
            // Where convexity bounds too little the points have to: then they are what is missing.
            let spanned = |error| match error {
                FitError::Program(_) | FitError::Unsolved(_) => {
                    let all = Structure::without_convexity(options.degree);
                    moments(&all, whitened).err().unwrap_or(error)
                }
                other => other,
            };
            let Optimum { coefficients, hessian, gram, gap, objective, solver, fallback } =
                generate(&problem, whitened, &[], watch).map_err(|error| spanned(error).of_objective(objective))?;
            let relaxation = |polynomial: &Polynomial| {
                let Some(power) = &power else { return Ok(None) };
                let gram =
                    HessianGram::nearest_with(polynomial, power, structure.hessian_basis.clone(), hessian.clone())
                        .map_err(SosBodyError::NotRelaxed)?;
                Ok(Some(Relaxation { c, linear: map.linear, offset: map.offset, gram }))
            };
            let gram = gram.ok_or(ProgramError::Singular)?;
            match certify(object, &structure, &coefficients, gram, relaxation) {
                Ok(body) => {
                    let (rounds, iterations) = (watch.progress().round, watch.progress().iterations);
                    let report = ProgramReport {
                        objective_value: objective,
                        optimality_gap: gap.unwrap_or(f64::INFINITY),
                        rounds,
                        iterations,
                        margin,
                        solver,
                        fallback,
                        log: watch.log().to_vec(),
                    };
                    return Ok((body, report));
                }
                Err(FitError::UnprovenSos(SosBodyError::NotRelaxed(_))) if margins.len() > 0 => {}
                Err(error) => return Err(error),
            }
        }
    }
}

/// Pulls all points inside by the constant coefficient and proves the set.
fn certify(
    object: &Object,
    structure: &Structure,
    coefficients: &DVector<f64>,
    gram: DMatrix<f64>,
    relaxation: impl FnOnce(&Polynomial) -> Result<Option<Relaxation>, SosBodyError>,
) -> Result<SosBody, FitError> {
    let normalization = object.normalization();
    let inverse = normalization.linear.try_inverse().ok_or(ProgramError::Singular)?;
    let placement = Placement::new(normalization.linear, inverse, normalization.center, 0.0, 0.0);
    let terms = structure.monomials.iter().copied().zip(coefficients.iter().copied()).collect();
    let polynomial = pulled_inside(Polynomial::new(terms)?, object.points(), &placement, 0.0, SLACK_BELOW_LEVEL);
    let gram = SosGram::nearest(&polynomial, monomials(structure.degree / 2), gram).map_err(SosBodyError::NotSos)?;
    let relaxation = relaxation(&polynomial)?;
    let body = SosBody::new(object.name(), normalization, polynomial, gram, relaxation)?;
    Ok(body.with_points(object.points())?)
}
