//! Meshes and point clouds.

use nalgebra::Vector3;

/// Vertices and the triangles between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// All vertices of the file, metres, also those of no triangle.
    pub points: Vec<Vector3<f64>>,
    /// Indices into the points; none for clouds. Faces of more corners are triangulated inside
    /// their outlines.
    pub triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// How many vertices the triangles use.
    pub fn used_points(&self) -> usize {
        self.are_used().into_iter().filter(|used| *used).count()
    }

    /// Whether the triangles use each vertex.
    pub(super) fn are_used(&self) -> Vec<bool> {
        let mut are_used = vec![false; self.points.len()];
        self.triangles.iter().flatten().for_each(|&corner| are_used[corner] = true);
        are_used
    }
}
