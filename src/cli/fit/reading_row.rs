//! What a report says of how a mesh was read.

use crate::fit::Reading;
use serde::Serialize;

/// What is odd about the file.
#[derive(Clone, Default, Serialize)]
pub(super) struct ReadingRow {
    /// Points left out since a coordinate of theirs was not finite.
    pub(super) dropped_points: usize,
    /// Vertices that no triangle uses, of files with triangles, and whether they were left out.
    pub(super) unused_vertices: usize,
    pub(super) unused_dropped: bool,
    /// Volume of the convex hull with and without them; none where there are none, or no volume.
    pub(super) hull_with_unused_m3: Option<f64>,
    pub(super) hull_without_unused_m3: Option<f64>,
}

impl From<&Reading> for ReadingRow {
    fn from(Reading { mesh, remarks }: &Reading) -> Self {
        let unused = remarks.unused.as_ref();
        let cost = unused.map(|unused| unused.cost(mesh));
        Self {
            dropped_points: remarks.dropped_points,
            unused_vertices: unused.map_or(0, |unused| unused.points.len()),
            unused_dropped: unused.is_some_and(|unused| unused.dropped),
            hull_with_unused_m3: cost.and_then(|cost| cost.hull_with_m3),
            hull_without_unused_m3: cost.and_then(|cost| cost.hull_without_m3),
        }
    }
}
