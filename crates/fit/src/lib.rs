//! Points to a certified body: hull, whitening, semidefinite program, certificate, proof.
//!
//! The way of one fit: [`input`] reads the points; [`hull`] leaves those that matter; the smallest
//! [`ellipsoid`] around them gives the normalized frame (`object`); `generate` minimises an
//! [`Objective`] over sos-convex polynomials with a margin by following the central path of the
//! dual (`path`); `refine` goes on to the volume itself; the constant coefficient pulls every input
//! point inside; [`Body::new`] proves the stored numbers; `slab` cuts off what is too much, and
//! [`gap`](gap()) bounds what is left of it. Nothing of that is believed: a fit returns a body only
//! with its proofs. A [`ladder`](ladder()) has several of them. [`fit_sos`] goes the same way to
//! sets that need not be convex.

mod ball;
mod barrier;
mod basis;
mod certificate;
mod conic;
mod coordinates;
mod cuboid;
mod decompose;
mod descent;
mod dominance;
pub mod ellipsoid;
mod enclose;
mod facing;
mod factor;
mod gap;
mod generate;
pub mod hull;
pub mod input;
mod ladder;
mod lorentz;
mod merge;
mod model;
mod moment;
mod object;
mod objective;
mod outermost;
mod parts;
mod path;
mod program;
mod progress;
mod refine;
mod reflex;
mod segment;
pub mod shapes;
mod shortfall;
mod slab;
mod sos;
mod spectral;
mod split;
mod structure;
mod support;
mod thicken;
mod trim;
mod volume;

pub use ball::{EnclosingBall, smallest_ball};
pub use certificate::{NoCertificate, certificate};
pub use coordinates::Coordinates;
pub use cuboid::{OrientedBox, smallest_box};
pub use decompose::{PartSearch, convex_parts};
pub use enclose::{
    Cover, EncloseError, EncloseOptions, Enclosure, Group, MAX_MULTIPLIER_DEGREE, MAX_SETS, NoContainment, Region,
    containment, enclose, enclose_obstacles, group,
};
pub use gap::{Gap, gap};
pub use hull::HullError;
pub use input::{
    Mesh, ReadError, ReadOptions, Reading, Remarks, Scale, ScaleError, Unused, UnusedCost, parse_mesh, read_mesh,
};
pub use ladder::{MAX_SLABS, Representation, Rung, ball, cheapest_within, coarsest_within, ladder};
pub use parts::{CompoundFit, MAX_PIECES, fit_parts};
pub use program::ProgramError;
pub use progress::Progress;
pub use refine::RefinementEnd;
pub use shortfall::Shortfall;
pub use slab::CutError;
pub use sos::{ProgramReport, SosFit, SosOptions, SosReport, fit_sos};
pub use sublevel_core::body::{Cone, Objective, SosMethod, UnknownCone, UnknownObjective};
pub use thicken::thicken;
pub use trim::{Trimmed, trim};

use nalgebra::Vector3;
use object::Object;
use std::ops::ControlFlow;
use sublevel_core::body::{
    Body, BodyError, CompoundError, MeshError, NotContained, NotCovered, SosBodyError, TriangleError, check_name,
};
use sublevel_core::polynomial::PolynomialError;

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
    /// Coordinates that traces are measured in.
    pub coordinates: Coordinates,
    /// Where the Gram matrix of the Hessian form is taken from. Over the smaller cones the volume
    /// itself is minimised, in a fraction of the time: the objective then stays at its default, and
    /// there is nothing to refine.
    pub cone: Cone,
    /// Whether to minimise the volume itself, starting from the optimum of the objective.
    pub refine: bool,
    /// How many slabs to cut the body by, each across the direction in which it reaches farthest
    /// beyond the hull: 0 to [`MAX_SLABS`].
    pub slabs: usize,
    /// Smallest eigenvalue asked of the Gram matrix of the Hessian form in the whitened frame; in
    /// (0, 1e-2].
    ///
    /// It pays for the rounding of the certificate. Volumes grow by about a part in 10⁴ at 1e-4.
    /// The objectives of that very matrix keep it definite by themselves.
    pub margin: f64,
    /// Name of the input, for the provenance of the body.
    pub input: String,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            degree: 6,
            objective: Objective::default(),
            coordinates: Coordinates::default(),
            cone: Cone::default(),
            refine: false,
            slabs: 0,
            margin: DEFAULT_MARGIN,
            input: String::new(),
        }
    }
}

impl FitOptions {
    /// Checks the options and the name of a body to be fitted, before any work.
    ///
    /// # Errors
    /// [`FitError::Degree`], [`FitError::Objective`], [`FitError::Cone`], [`FitError::Slabs`],
    /// [`FitError::Margin`] or [`FitError::Name`].
    pub fn check(&self, name: &str) -> Result<(), FitError> {
        if ![2, 4, 6, 8].contains(&self.degree) {
            return Err(FitError::Degree(self.degree));
        }
        if self.degree > self.objective.max_degree() {
            return Err(FitError::Objective { objective: self.objective, degree: self.degree });
        }
        if self.cone != Cone::Sos && (self.objective != Objective::default() || self.refine) {
            return Err(FitError::Cone(self.cone));
        }
        if self.slabs > MAX_SLABS {
            return Err(FitError::Slabs(self.slabs));
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
    /// Programs solved, one per set of points and one per step of a refinement.
    pub rounds: usize,
    /// Newton steps of all of them.
    pub iterations: usize,
    /// What was minimised, but over the smaller cones.
    pub objective: Objective,
    /// Its optimal value: log dets in the whitened frame, traces in the chosen coordinates.
    /// Over which polynomials; the volume itself if these are not all the sos-convex ones.
    pub cone: Cone,
    /// What was reached: log dets in the whitened frame, traces in the unit frame, volumes over the
    /// smaller cones in the whitened frame.
    pub objective_value: f64,
    /// Margin the certificate was proven with.
    pub margin: f64,
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
    /// Convexity relaxed by nothing, or less.
    #[error(
        "relax convexity: {0} is not positive; give c > 0, or inf for no bound of convexity, or fit a convex body, which is c = 0"
    )]
    Relaxation(f64),
    /// The objective measures what is relaxed.
    #[error(
        "objective: {0} measures the Hessian form, which relaxed convexity leaves indefinite; take logdet-p or trace-p"
    )]
    RelaxedObjective(Objective),
    /// An objective or a refinement is asked for over one of the smaller cones.
    #[error(
        "cone: over {0} the volume itself is minimised, which leaves nothing to choose or refine; leave objective and \
         refinement at their defaults, or take the cone sos"
    )]
    Cone(Cone),
    /// Too many slabs.
    #[error("slabs: {0} is more than {MAX_SLABS}; raise the degree instead")]
    Slabs(usize),
    /// The gap asked for is not a length.
    #[error("max gap: {0} m is not positive; give the distance that the body may reach beyond the convex hull")]
    MaxGap(f64),
    /// No representation is as close as asked for.
    #[error(
        "max gap: the closest body, of degree {degree} with {slabs} slab(s), is only proven to reach at most {reached_m:.3e} m beyond the convex \
         hull, {asked_m:.3e} m are asked for; allow more, or split the object into several inputs"
    )]
    Gap {
        /// Gap asked for, metres.
        asked_m: f64,
        /// Least gap reached, metres.
        reached_m: f64,
        /// Degree of that body.
        degree: usize,
        /// Slabs of that body.
        slabs: usize,
    },
    /// The margin is outside its range.
    #[error("margin: {0} is not in (0, 0.01]; leave it at {DEFAULT_MARGIN:e} unless a certificate fails")]
    Margin(f64),
    /// More than may be left out, or less than nothing.
    #[error("trim: {0} is not between 0 and 0.5; give the fraction of the points to leave out, such as 0.01")]
    Trim(f64),
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
    /// The points lie on a surface.
    #[error(
        "points: they span only {rank} of the {monomials} monomials of degree {} (they are too few, or all near a surface of that \
         degree), so nothing bounds a polynomial of degree {degree}; lower the degree, add points, or fit a convex body (c = 0)",
        degree / 2
    )]
    Span {
        /// Degree of the polynomial.
        degree: usize,
        /// Rank of the moment matrix but for rounding.
        rank: usize,
        /// Monomials of half the degree.
        monomials: usize,
    },
    /// A triangle names a point that is not there.
    #[error("triangles: {0}")]
    Triangles(#[from] TriangleError),
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
    #[error("the fit is only known to be within {gap:.1e} of the optimal objective; lower the degree, or add points")]
    NotOptimal {
        /// Objective minus its lower bound from the dual.
        gap: f64,
    },
    /// What another objective might have reached.
    #[error("{0}, or take the objective logdet-p, which no frame makes worse")]
    OtherObjective(Box<FitError>),
    /// The numbers make no polynomial.
    #[error("the fitted polynomial is unusable: {0}; lower the degree")]
    Polynomial(#[from] PolynomialError),
    /// The body could not be proven.
    #[error("the fitted polynomial could not be proven, also with a hundred times the margin: {0}; lower the degree")]
    Unproven(#[from] BodyError),
    /// The set that need not be convex could not be proven.
    #[error("the fitted polynomial could not be proven: {0}; lower the degree")]
    UnprovenSos(#[from] SosBodyError),
    /// A point could not be proven inside.
    #[error("the fitted polynomial could not be proven to contain the points: {0}; lower the degree")]
    NotContained(#[from] NotContained),
    /// More parts than can be asked for, or none.
    #[error("parts: {0} is not between 1 and {MAX_PIECES}; a few to a dozen suit most objects")]
    Parts(usize),
    /// The mesh is none.
    #[error("mesh: {0}")]
    Mesh(#[from] MeshError),
    /// The parts make no compound.
    #[error(transparent)]
    Compound(#[from] CompoundError),
    /// The parts could not be proven to cover the mesh.
    #[error("the compound could not be proven to cover the mesh: {0}; ask for fewer parts or a lower degree")]
    NotCovered(#[from] NotCovered),
    /// A slab could not be added.
    #[error("the body could not be cut by a slab: {0}; ask for fewer slabs, or a larger gap")]
    Cut(#[from] CutError),
}

impl FitError {
    /// The same error with the advice to take the default objective, where it was not taken and may
    /// help.
    fn of_objective(self, objective: Objective) -> Self {
        match self {
            Self::Program(_) | Self::NotOptimal { .. } if objective != Objective::default() => {
                Self::OtherObjective(Box::new(self))
            }
            other => other,
        }
    }
}

/// Fits a body of one polynomial around `points` (metres) with the least [`FitOptions::objective`],
/// and cuts it by [`FitOptions::slabs`].
///
/// Log dets are least in every affine frame at once. Traces depend on the frame: they are measured
/// in [`FitOptions::coordinates`].
///
/// `progress` hears of every Newton step (below a millisecond at degree 4 to tens of milliseconds
/// at degree 8), those of a refinement included, and can stop the fit.
///
/// # Errors
/// [`FitError`]: bad input by field, a cancelled fit, or what could not be solved or proven and by how much.
pub fn fit(
    name: &str,
    points: &[Vector3<f64>],
    options: &FitOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    options.check(name)?;
    let object = Object::new(name, points, &options.input)?;
    object.cut(object.fit(options, progress)?, options.slabs, 0.0, progress)
}

/// As [`fit()`], of points that have changed a little since `previous` was fitted, as those of the
/// next scan of a stream: the program begins with the points near the surface of that body, which
/// saves it rounds of looking for those that bound the new one. The answer is that of a fit from
/// scratch within the optimality gap, whatever the body is.
///
/// # Errors
/// As [`fit()`].
pub fn refit(
    previous: &Body,
    points: &[Vector3<f64>],
    options: &FitOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    options.check(previous.name())?;
    let object = Object::new(previous.name(), points, &options.input)?;
    object.begin_with(previous);
    object.cut(object.fit(options, progress)?, options.slabs, 0.0, progress)
}

#[cfg(test)]
mod tests;
