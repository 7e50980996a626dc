//! Which triangles of a mesh a set is proven to contain.

use serde::{Deserialize, Serialize};

/// What of a mesh a set contains.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Triangles of the mesh.
    pub triangles: usize,
    /// How many of them are not proven to lie inside whole.
    pub uncovered: usize,
    /// Area of the mesh, m².
    pub area_m2: f64,
    /// Area of the triangles that are not proven inside, m²; parts of them may be.
    pub uncovered_area_m2: f64,
    /// The largest of them.
    pub largest: Option<Uncovered>,
}

/// A triangle that is not proven to lie inside whole.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Uncovered {
    /// Its position in the mesh, from 0.
    pub triangle: usize,
    /// Its area, m².
    pub area_m2: f64,
    /// A value that the polynomial takes on it, up to rounding: above 1 unless only the proof
    /// failed.
    pub value: f64,
    /// Proven upper bound of the values that it takes there.
    pub value_upper: f64,
}

/// A triangle that names a point that is not there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "triangle {triangle} (counted from 0) has the vertex {vertex}, but there are {points} points; export the mesh again"
)]
pub struct TriangleError {
    /// Which triangle.
    pub triangle: usize,
    /// The vertex, from 0.
    pub vertex: usize,
    /// Number of points.
    pub points: usize,
}
