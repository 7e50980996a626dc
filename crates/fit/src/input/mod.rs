//! Meshes and point clouds from files.
//!
//! The content of a file is read or refused: what a reader does not consume is an error, and
//! counts, terminators and sizes that a format has are checked. Numbers that stand there as text
//! are read in double precision; binary ones have the precision of the format. One convex body that
//! holds the vertices holds every triangle; what several bodies hold together, or one that is not
//! convex, is known by the triangles.

mod collada;
mod error;
mod foreign;
mod mesh;
mod obj;
mod off;
mod options;
mod ply;
mod polygon;
mod remarks;
mod scale;
mod stl;
mod surface;
mod text;
mod xyz;

pub(crate) use error::Defect;
pub use error::ReadError;
pub use mesh::Mesh;
pub use options::ReadOptions;
pub use remarks::{Remarks, Unused, UnusedCost};
pub use scale::{Scale, ScaleError};

use std::path::Path;
use surface::SurfaceError;

/// Endings of the formats that can be read.
pub const FORMATS: [&str; 6] = ["off", "obj", "ply", "stl", "dae", "xyz"];

/// The content of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// The mesh.
    pub mesh: Mesh,
    /// What was left out of it or is odd about it.
    pub remarks: Remarks,
}

/// Reads the mesh or point cloud at `path`; the ending of its name determines the format.
///
/// # Errors
/// [`ReadError`]; every variant names the file, the place, the reason and the remedy. Counts and
/// indices are not trusted.
pub fn read_mesh(path: &Path, options: &ReadOptions) -> Result<Reading, ReadError> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !FORMATS.contains(&extension.as_str()) {
        return Err(ReadError::UnknownFormat { path: path.to_owned(), extension });
    }
    let bytes = std::fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse_mesh(&bytes, &extension, path, options)
}

/// The mesh in the content of a file whose format is one of [`FORMATS`]; `path` names it in errors.
///
/// # Errors
/// As [`read_mesh`].
pub fn parse_mesh(bytes: &[u8], format: &str, path: &Path, options: &ReadOptions) -> Result<Reading, ReadError> {
    if foreign::is_lfs_pointer(bytes) {
        return Err(ReadError::LfsPointer { path: path.to_owned(), bytes: bytes.len() });
    }
    let surface = match format {
        "off" => off::read(bytes),
        "obj" => obj::read(bytes),
        "ply" => ply::read(bytes),
        "stl" => stl::read(bytes),
        "dae" => collada::read(bytes),
        "xyz" => xyz::read(bytes),
        _ => {
            return Err(ReadError::UnknownFormat { path: path.to_owned(), extension: format.to_owned() });
        }
    };
    let mesh = surface.map_err(SurfaceError::from).and_then(|surface| surface.into_mesh(options));
    let (mut mesh, mut remarks) = mesh.map_err(|error| match error {
        SurfaceError::Defect(Defect { place, reason, remedy }) => {
            ReadError::Malformed { path: path.to_owned(), place, reason, remedy }
        }
        SurfaceError::NotFinite { vertex, coordinates } => {
            ReadError::NotFinite { path: path.to_owned(), vertex, coordinates }
        }
    })?;
    if mesh.points.is_empty() {
        return Err(ReadError::Empty { path: path.to_owned(), dropped: remarks.dropped_points });
    }
    remarks.unused = Unused::find(&mut mesh, options.drop_unused);
    Ok(Reading { mesh, remarks })
}

#[cfg(test)]
mod tests;
