//! The objects and the pairs of them.

use super::ComparisonError;
use nalgebra::Vector3;
use std::path::Path;
use sublevel::fit::{Mesh, ReadOptions, hull::convex_hull, read_mesh};

/// The pairs, by the names of their objects.
const PAIRS: [(&str, &str); 7] = [
    ("chair", "human"),
    ("mug", "table"),
    ("hand", "vase"),
    ("octopus", "chair"),
    ("mustard", "scissors"),
    ("banana", "crackers"),
    ("spot", "bunny"),
];
/// How many of them a quick run measures.
const QUICK_PAIRS: usize = 2;

/// Where the mesh of an object lies in the data.
const FILES: [(&str, &str); 14] = [
    ("chair", "psb/101.off"),
    ("human", "psb/10.off"),
    ("hand", "psb/181.off"),
    ("vase", "psb/361.off"),
    ("octopus", "psb/121.off"),
    ("mug", "meshes/mbm_mug.off"),
    ("table", "meshes/mbm_table.off"),
    ("wingnut", "meshes/wingnut.off"),
    ("mustard", "meshes/ycb_mustardbottle.off"),
    ("scissors", "meshes/ycb_scissors.off"),
    ("banana", "meshes/ycb_banana.off"),
    ("crackers", "meshes/ycb_crackerbox.off"),
    ("spot", "meshes/spot.off"),
    ("bunny", "meshes/bunny.off"),
];

/// An object.
#[derive(Clone, Debug)]
pub struct Subject {
    /// Its name, for people.
    pub name: &'static str,
    /// Its surface, metres.
    pub mesh: Mesh,
    /// The vertices of its convex hull.
    pub hull: Vec<Vector3<f64>>,
    /// Largest distance of two of its points, metres.
    pub diameter_m: f64,
}

/// The pairs of the figures, or the first two.
///
/// # Errors
/// [`ComparisonError::Mesh`] or [`ComparisonError::Hull`].
pub fn pairs(data: &Path, quick: bool) -> Result<Vec<[Subject; 2]>, ComparisonError> {
    let pairs = if quick { &PAIRS[..QUICK_PAIRS] } else { &PAIRS[..] };
    pairs.iter().map(|(a, b)| Ok([Subject::read(a, data)?, Subject::read(b, data)?])).collect()
}

impl Subject {
    /// Reads it from the folder with the data.
    ///
    /// # Errors
    /// [`ComparisonError::Mesh`] or [`ComparisonError::Hull`].
    pub fn read(name: &'static str, data: &Path) -> Result<Self, ComparisonError> {
        let file = FILES.iter().find(|(known, _)| *known == name).map_or(name, |(_, file)| file);
        let mesh = read_mesh(&data.join(file), &ReadOptions::default())?.mesh;
        let hull = convex_hull(&mesh.points).map_err(|source| ComparisonError::Hull { mesh: name, source })?;
        let hull: Vec<Vector3<f64>> = hull.vertices.iter().map(|&i| mesh.points[i]).collect();
        let apart = |a: &Vector3<f64>| hull.iter().map(|b| (b - a).norm_squared()).fold(0.0, f64::max);
        let diameter_m = hull.iter().map(apart).fold(0.0, f64::max).sqrt();
        Ok(Self { name, mesh, hull, diameter_m })
    }
}
