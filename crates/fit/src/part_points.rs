//! The points of the parts that a mesh is divided among.

use super::error::FitError;
use nalgebra::Vector3;
use sublevel_core::body::{Division, NotCovered, Piece};

/// The corners of the pieces of one part.
pub(super) struct PartPoints {
    pub(super) points: Vec<Vector3<f64>>,
    /// How far they may be from what they stand for, metres.
    pub(super) uncertainty: f64,
}

/// The corners of the pieces of each part of a division.
pub(super) fn part_points(mesh: &Piece, division: &Division, parts: usize) -> Result<Vec<PartPoints>, FitError> {
    let pieces = division.pieces(mesh.clone(), parts).map_err(NotCovered::from)?;
    let corners = |pieces: Vec<Piece>| PartPoints {
        points: pieces.iter().flat_map(Piece::spots).map(|spot| spot.x).collect(),
        uncertainty: pieces.iter().map(Piece::uncertainty).fold(0.0, f64::max),
    };
    Ok(pieces.into_iter().map(corners).collect())
}
