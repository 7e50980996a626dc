//! Meshes and point clouds from files. One convex body that holds the vertices holds every triangle; what several bodies hold
//! together, or one that is not convex, is told by the triangles.

mod binary_aware;
mod text;

use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// Endings of the formats that can be read.
pub const FORMATS: [&str; 5] = ["off", "obj", "ply", "stl", "xyz"];

/// Why a file gives no points.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file could not be opened or read.
    #[error("{}: {source}; check the path and its permissions", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The ending of the name is none of [`FORMATS`].
    #[error(
        "{}: the format {extension:?} is not known; convert it to one of .off, .obj, .ply, .stl (text or binary) or .xyz",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The ending, without its dot; empty when there is none.
        extension: String,
    },
    /// The content is not what the format asks for.
    #[error("{}, {place}: {reason}; the file is truncated or damaged, export it again", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line, field or element.
        place: String,
        /// What is wrong there.
        reason: String,
    },
    /// A coordinate is NaN or infinite, in the file or after scaling.
    #[error(
        "{}: vertex {vertex} (counted from 0) has the coordinates ({}, {}, {}), which are not all finite; \
         remove it or repair the mesh",
        path.display(), coordinates[0], coordinates[1], coordinates[2]
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Index of the vertex, from 0.
        vertex: usize,
        /// Its coordinates, metres.
        coordinates: [f64; 3],
    },
    /// Fewer than four points bound no volume.
    #[error("{}: {count} points; a body needs at least 4 that do not lie in one plane", path.display())]
    TooFew {
        /// The file.
        path: PathBuf,
        /// How many there are.
        count: usize,
    },
    /// The scale is not a positive finite number.
    #[error("scale: {0} is not a positive finite number; give the metres per unit of the file, 0.001 for millimetres")]
    Scale(f64),
}

/// What a reader of one format found wrong, without the file's name.
#[derive(Debug, PartialEq)]
pub(crate) struct Defect {
    place: String,
    reason: String,
}

impl Defect {
    fn new(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { place: place.into(), reason: reason.into() }
    }

    fn line(index: usize, reason: impl Into<String>) -> Self {
        Self::new(format!("line {}", index + 1), reason)
    }
}

/// Vertices and the triangles between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// All vertices of the file, metres, also those of no triangle.
    pub points: Vec<Vector3<f64>>,
    /// Indices into the points. A face of more corners is the fan of triangles about its first corner; none for clouds.
    pub triangles: Vec<[usize; 3]>,
}

impl Mesh {
    /// Adds a face as the fan about its first corner; nothing for fewer than three corners.
    fn add_face(&mut self, corners: &[usize]) {
        let Some((&first, rest)) = corners.split_first() else { return };
        self.triangles.extend(rest.windows(2).map(|edge| [first, edge[0], edge[1]]));
    }
}

/// The vertices of the file at `path` in metres; `scale` is metres per unit of the file.
///
/// # Errors
/// As [`read_mesh`].
pub fn read_points(path: &Path, scale: f64) -> Result<Vec<Vector3<f64>>, ReadError> {
    read_mesh(path, scale).map(|mesh| mesh.points)
}

/// Vertices (metres) and triangles of the file at `path`; `scale` is metres per unit of the file.
///
/// # Errors
/// [`ReadError`]; every variant names the file, the place, the reason and the remedy. Counts and indices are not trusted.
pub fn read_mesh(path: &Path, scale: f64) -> Result<Mesh, ReadError> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err(ReadError::Scale(scale));
    }
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !FORMATS.contains(&extension.as_str()) {
        return Err(ReadError::UnknownFormat { path: path.to_owned(), extension });
    }
    let bytes = std::fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse(&bytes, &extension, path, scale)
}

pub(crate) fn parse(bytes: &[u8], extension: &str, path: &Path, scale: f64) -> Result<Mesh, ReadError> {
    let mesh = match extension {
        "off" => text::off(bytes),
        "obj" => text::obj(bytes),
        "xyz" => text::xyz(bytes),
        "ply" => binary_aware::ply(bytes),
        _ => binary_aware::stl(bytes),
    };
    let malformed = |Defect { place, reason }| ReadError::Malformed { path: path.to_owned(), place, reason };
    let mut mesh = mesh.map_err(malformed)?;
    for (vertex, point) in mesh.points.iter_mut().enumerate() {
        *point *= scale;
        if !point.iter().all(|v| v.is_finite()) {
            let coordinates = [point.x, point.y, point.z];
            return Err(ReadError::NotFinite { path: path.to_owned(), vertex, coordinates });
        }
    }
    let count = mesh.points.len();
    if count < 4 {
        return Err(ReadError::TooFew { path: path.to_owned(), count });
    }
    match mesh.triangles.iter().flatten().find(|&&corner| corner >= count) {
        Some(corner) => {
            Err(malformed(Defect::new("faces", format!("vertex {corner} (counted from 0) of {count} is asked for"))))
        }
        None => Ok(mesh),
    }
}

#[cfg(test)]
mod tests;
