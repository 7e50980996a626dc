//! Certified convex bodies: `{x : g_1(x) <= 1, ..., g_m(x) <= 1}` with sos-convex `g_i`, proven
//! bounded and non-empty.
//!
//! A [`Body`] exists only with its proofs: making one, from numbers or from a file, checks every
//! certificate and proves or recomputes everything derived from the polynomials. What need not be
//! convex is an [`SosBody`], which [`crate::branch_and_bound`] measures. Lengths are metres in the
//! body frame unless a name says otherwise; `z` is the unit-free normalized frame, `z = L (x - c)`.

mod body_error;
mod bounds;
mod cap;
mod closed_form;
mod component;
mod compound;
mod compound_file;
mod cone;
mod constraint;
mod contained_file;
mod contained_points;
mod containment;
mod convex_body;
mod covering;
mod direction_grid;
mod division;
mod error_bounds;
mod file;
mod file_error;
mod file_format;
mod id;
mod mesh_cover;
mod mesh_piece;
mod normalization;
mod objective;
mod obstacle;
mod part_tree;
mod placement;
mod primitives;
mod provenance;
mod radial;
mod shape;
mod solid;
mod solver;
mod sos;
mod sphere;
mod spot;
mod support_bounds;
mod support_heights;
mod support_table;
mod union;

pub use body_error::{BodyError, check_name};
pub use bounds::{Aabb, Ball};
pub use closed_form::{ClosedForm, ExactShape};
pub use compound::{Compound, CompoundError, MAX_PARTS};
pub use cone::{Cone, UnknownCone};
pub(crate) use constraint::largest;
pub use constraint::{Constraint, MAX_CONSTRAINTS};
pub use contained_points::{ContainedPoints, NotContained};
pub use containment::{BasicSet, ContainedSet, Containment, ProofFrame};
pub use convex_body::{Body, Support};
pub use covering::{Covered, Covering};
pub use division::{Cut, Division, DivisionError};
pub use error_bounds::{ConstraintTrust, Trust};
pub use file_error::BodyFileError;
pub use id::{BodyId, ParseIdError};
pub use mesh_cover::NotCovered;
pub use mesh_piece::{Caps, MeshError, Piece};
pub use normalization::Normalization;
pub use objective::{Objective, UnknownObjective};
pub use obstacle::Obstacle;
pub use part_tree::{Centers, NodeContent, PartCenters, PartNode, PartTree};
pub use placement::{Placement, Sample};
pub use provenance::Provenance;
pub use radial::Volume;
pub use radial::{boundary_radius, sphere_rule};
pub use shape::Shape;
pub use solid::Solid;
pub use solver::{Solver, SolverStep, UnknownSolver};
pub use sos::{Coverage, Relaxation, SosBody, SosBodyError, SosMethod, TriangleError, Uncovered};
pub use sphere::{Sphere, fibonacci_lattice};
pub use spot::Spot;
pub use support_table::{Cell, Outline};

#[cfg(test)]
mod tests;
