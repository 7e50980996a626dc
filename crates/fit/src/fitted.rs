//! Fitted bodies, and how they came about.

use super::gap::Gap;
use super::refine::RefinementEnd;
use sublevel_core::body::Body;
use sublevel_core::body::Cone;
use sublevel_core::body::Objective;
use sublevel_core::body::{Solver, SolverStep};

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
    /// Volumes of the refinement before its first step and after each, m³, by the rule that it
    /// minimises; over the smaller cones after each step from the smallest ellipsoid; none without
    /// either.
    pub refinement_m3: Vec<f64>,
    /// Volume of the convex hull, m³.
    pub hull_volume_m3: f64,
    /// Wall time, seconds.
    pub seconds: f64,
    /// Why the refinement ended, or the descent over one of the smaller cones; none without either.
    pub refinement_end: Option<RefinementEnd>,
    /// [`FitReport::objective_value`] minus its lower bound from the dual; at most 1e-5 max(1,
    /// |value|). None for volumes: they are not convex in the polynomial, and no lower bound of
    /// theirs is known.
    pub optimality_gap: Option<f64>,
    /// Programs solved, those of the steps of a refinement among them.
    pub rounds: usize,
    /// Iterations of all of them.
    pub iterations: usize,
    /// What was minimised, but over the smaller cones.
    pub objective: Objective,
    /// Over which polynomials; the volume itself if these are not all the sos-convex ones.
    pub cone: Cone,
    /// What was reached: log dets in the whitened frame, traces in the chosen coordinates, volumes
    /// over the smaller cones in the whitened frame.
    pub objective_value: f64,
    /// Margin the certificate was proven with.
    pub margin: f64,
    /// What solved the program.
    pub solver: Solver,
    /// Why the solver that was tried first did not, if one was.
    pub fallback: Option<String>,
    /// The iterations of the conic solver, of all programs.
    pub log: Vec<SolverStep>,
}

/// A fitted body and how it came about.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The body: proven sos-convex, bounded, and to contain every input point.
    pub body: Body,
    /// How far it reaches beyond the convex hull of the points.
    pub gap: Gap,
    /// What it took.
    pub report: FitReport,
}

/// One representation of an object, which it contains.
#[derive(Clone, Debug)]
pub struct Rung {
    /// The body, proven.
    pub body: Body,
    /// How far it reaches beyond the convex hull of the points.
    pub gap: Gap,
    /// Wall time, seconds, with all that was tried before.
    pub seconds: f64,
    /// What the fit took and reached; none for the ball.
    pub report: Option<FitReport>,
}

impl From<Fit> for Rung {
    fn from(fit: Fit) -> Self {
        Self { body: fit.body, gap: fit.gap, seconds: fit.report.seconds, report: Some(fit.report) }
    }
}
