//! What to fit.

use super::coordinates::Coordinates;
use super::error::FitError;
use super::margin::DEFAULT_MARGIN;
use super::slab::MAX_SLABS;
use sublevel_core::body::Cone;
use sublevel_core::body::Objective;
use sublevel_core::body::Solver;
use sublevel_core::body::check_name;

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
    /// itself is minimised, without semidefinite programs: the objective then stays at its default,
    /// and there is nothing to refine.
    pub cone: Cone,
    /// Whether to minimise the volume itself, starting from the optimum of the objective.
    pub refine: bool,
    /// How many slabs to cut the body by, each across the direction in which it reaches farthest
    /// beyond the hull: 0 to [`MAX_SLABS`].
    pub slabs: usize,
    /// Smallest eigenvalue asked of the Gram matrix of the Hessian form in the whitened frame; in
    /// (0, 1e-2].
    ///
    /// It absorbs the rounding of the certificate. Volumes grow by about a part in 10⁴ at 1e-4.
    /// The objectives of that very matrix keep it definite by themselves.
    pub margin: f64,
    /// What solves the program; none takes the faster one, and the other if that fails. The
    /// structured solver has [`Objective::LogDetP`] only, over [`Cone::Sos`].
    pub solver: Option<Solver>,
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
            solver: None,
            input: String::new(),
        }
    }
}

impl FitOptions {
    /// Checks the options and the name of a body to be fitted, before any work.
    ///
    /// # Errors
    /// [`FitError::Degree`], [`FitError::Objective`], [`FitError::Cone`], [`FitError::Solver`],
    /// [`FitError::Slabs`], [`FitError::Margin`] or [`FitError::Name`].
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
        let is_structured = self.objective == Objective::LogDetP && self.cone == Cone::Sos;
        if self.solver == Some(Solver::Structured) && !is_structured {
            return Err(FitError::Solver);
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
