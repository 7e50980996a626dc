//! The record of the mesh that a compound was proven to cover.

use super::contained_points::ContainedPoints;
use super::division::{Cut, Division};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// How much of a mesh is covered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Covered {
    /// Every triangle, but not what an open mesh may be thought to enclose.
    SurfaceOnly,
    /// Every triangle, and every point about which the closed mesh has a winding number other than
    /// 0.
    Interior,
}

impl Covered {
    /// As files and reports call it.
    pub fn name(self) -> &'static str {
        match self {
            Covered::SurfaceOnly => "surface_only",
            Covered::Interior => "interior",
        }
    }
}

/// Which mesh a compound was proven to cover, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "Record", into = "Record")]
pub struct Covering {
    /// How much of it.
    pub proven: Covered,
    /// The corners of its triangles, one triangle after the other.
    pub corners: ContainedPoints,
    /// How it is divided among the parts.
    pub division: Division,
}

/// As files have it. The first files had no components, and one piece to a part.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Record {
    proven: Covered,
    corners: ContainedPoints,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    separated: bool,
    cuts: Vec<Cut>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    parts: Vec<usize>,
}

impl From<Record> for Covering {
    fn from(Record { proven, corners, separated, cuts, parts }: Record) -> Self {
        Self { proven, corners, division: Division { separated, cuts, parts } }
    }
}

impl From<Covering> for Record {
    fn from(Covering { proven, corners, division: Division { separated, cuts, parts } }: Covering) -> Self {
        Self { proven, corners, separated, cuts, parts }
    }
}

impl Covering {
    /// The record of a mesh: the corners of its triangles, all of which must exist.
    pub fn corners(points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> ContainedPoints {
        let corners: Vec<_> = triangles.iter().flatten().map(|&corner| points[corner]).collect();
        ContainedPoints::of(&corners)
    }
}
