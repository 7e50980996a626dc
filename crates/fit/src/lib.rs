//! Points to a certified body: hull, whitening, semidefinite program, certificate, proof.
//!
//! The steps of one fit: [`input`] reads the points; [`hull`] leaves those that matter; the
//! smallest [`ellipsoid`] around them gives the normalized frame (`object`); `generate` minimises
//! an [`Objective`] over sos-convex polynomials with a margin by following the central path of the
//! dual (`path`); `refine` then minimises the volume itself; the constant coefficient pulls every
//! input point inside; [`Body::new`] proves the stored numbers; `slab` cuts off what is too much,
//! and [`gap`](gap()) bounds what is left of it. No proof depends on any of that: a fit returns a
//! body only with its proofs. A [`ladder`](ladder()) has several of them. [`fit_sos`] takes the
//! same steps to sets that need not be convex.

mod active_points;
mod ball;
mod barrier;
mod basis;
mod certificate;
mod conic_program;
mod coordinates;
mod cuboid;
mod decompose;
mod descent;
mod dominance;
pub mod ellipsoid;
mod enclose;
mod error;
mod facets;
mod facing;
mod factor;
mod farthest_points;
mod fitted;
mod gap;
mod generate;
mod hierarchy;
pub mod hull;
pub mod input;
mod ladder;
mod localizing;
mod margin;
mod margin_program;
mod merge;
mod model;
mod moment;
mod moment_program;
mod object;
mod objective;
mod options;
mod outermost;
mod part_points;
mod parts;
mod path;
mod program;
mod progress;
mod refine;
mod reflex;
mod rungs;
mod segment;
pub mod shapes;
mod shortfall;
mod slab;
mod sos;
mod spaced_points;
mod spectral;
mod split;
mod structure;
mod support;
mod thicken;
mod trim;
mod unsolved;
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
pub use error::FitError;
pub use fitted::{Fit, FitReport, Rung};
pub use gap::{Gap, gap};
pub use hierarchy::{
    HierarchyBound, HierarchyError, HierarchyLevelBound, MAX_LEVEL, PlacedSet, check_hierarchy, check_hierarchy_level,
    hierarchy_distance, hierarchy_level_distance,
};
pub use hull::HullError;
pub use input::{
    Mesh, ReadError, ReadOptions, Reading, Remarks, Scale, ScaleError, Unused, UnusedCost, parse_mesh, read_mesh,
};
pub use ladder::{Representation, ball, cheapest_within, coarsest_within, ladder};
pub use margin::DEFAULT_MARGIN;
pub use options::FitOptions;
pub use parts::{CompoundFit, fit_parts};
pub use progress::Progress;
pub use refine::RefinementEnd;
pub use shortfall::{MAX_PIECES, Shortfall};
pub use slab::{CutError, MAX_SLABS};
pub use sos::{ProgramReport, SosFit, SosOptions, SosReport, fit_sos};
pub use sublevel_core::body::{
    Cone, Objective, Solver, SolverStep, SosMethod, UnknownCone, UnknownObjective, UnknownSolver,
};
pub use thicken::thicken;
pub use trim::{Trimmed, trim};
pub use unsolved::{Failure, Fault, ProgramError, Stop, Unsolved};

use nalgebra::Vector3;
use object::Object;
use std::ops::ControlFlow;
use sublevel_core::body::Body;

/// Fits a body of one polynomial around `points` (metres) with the least [`FitOptions::objective`],
/// and cuts it by [`FitOptions::slabs`].
///
/// Log dets are least in every affine frame at once. Traces depend on the frame: they are measured
/// in [`FitOptions::coordinates`].
///
/// `progress` is called at every iteration of the solver (a few milliseconds at degree 4 to a
/// second at degree 8), those of a refinement included, and can stop the fit; it must not fit
/// itself.
///
/// # Errors
/// [`FitError`]: bad input by field, a cancelled fit, or what could not be solved or proven and by
/// how much.
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
/// next scan of a stream: where a program does not begin with all points (those of the structured
/// solver, and of more than a thousand vertices), it begins with those near the surface of that
/// body, which saves it rounds of looking for those that bound the new one. The answer is that of a
/// fit from scratch within the optimality gap, whatever the body is.
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
