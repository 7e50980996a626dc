//! Why there is no fit.

use super::hull::HullError;
use super::margin::DEFAULT_MARGIN;
use super::shortfall::MAX_PIECES;
use super::slab::{CutError, MAX_SLABS};
use super::unsolved::{ProgramError, Unsolved};
use sublevel_core::body::Cone;
use sublevel_core::body::Objective;
use sublevel_core::body::{BodyError, CompoundError, MeshError, NotContained, NotCovered, SosBodyError, TriangleError};
use sublevel_core::polynomial::PolynomialError;

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
    /// The structured solver is asked for what it has no program for.
    #[error("solver: structured solves logdet-p over the cone sos only; take clarabel, or leave the solver out")]
    Solver,
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
    /// What leads to the program of a fit was lost in rounding.
    #[error("{0}; lower the degree, or add points")]
    Program(#[from] ProgramError),
    /// No solver has an optimum of the program of a fit that is verified.
    #[error("{0}")]
    Unsolved(Unsolved),
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
    pub(super) fn of_objective(self, objective: Objective) -> Self {
        match self {
            Self::Program(_) | Self::Unsolved(_) if objective != Objective::default() => {
                Self::OtherObjective(Box::new(self))
            }
            other => other,
        }
    }
}
