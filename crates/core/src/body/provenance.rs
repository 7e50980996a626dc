//! Where a body comes from.

use super::solver::Solver;
use serde::{Deserialize, Serialize};

/// Where a fitted body comes from; information only, not part of its identity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the input, without its folder.
    pub input: String,
    /// Objective of the fit, such as `logdet-p`.
    pub objective: String,
    /// Whether the volume was refined after the fit.
    pub refined: bool,
    /// Vertices of the convex hull of the input.
    pub hull_vertices: usize,
    /// Volume of the convex hull, m³.
    pub hull_volume_m3: f64,
    /// What solved the program; none where no program made it, as of balls, or an older file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solver: Option<Solver>,
}
