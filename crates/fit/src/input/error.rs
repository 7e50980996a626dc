//! Why a file gives no mesh.

use super::ScaleError;
use std::path::PathBuf;

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
    /// The ending of the name is none of [`FORMATS`](super::FORMATS).
    #[error(
        "{}: the format {extension:?} is not known; convert it to one of .off, .obj, .ply, .stl (text or binary), \
         .dae or .xyz",
        path.display()
    )]
    UnknownFormat {
        /// The file.
        path: PathBuf,
        /// The ending, without its dot; empty when there is none.
        extension: String,
    },
    /// The scale is none.
    #[error(transparent)]
    Scale(#[from] ScaleError),
    /// The file stands for a mesh that is stored elsewhere.
    #[error(
        "{}: this is a Git LFS pointer of {bytes} bytes, not the mesh; run `git lfs pull` in its repository, or \
         download the mesh itself",
        path.display()
    )]
    LfsPointer {
        /// The file.
        path: PathBuf,
        /// Its length, bytes.
        bytes: usize,
    },
    /// The content is not what the format asks for.
    #[error("{}, {place}: {reason}; {remedy}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line, field or element.
        place: String,
        /// What is wrong there.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },
    /// A coordinate is NaN or infinite, in the file or after scaling.
    #[error(
        "{}: vertex {vertex} (counted from 0) has the coordinates ({:e}, {:e}, {:e}), which are not all finite; \
         remove it, repair the mesh, or leave such points out by --drop-nan",
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
    /// There is nothing to read.
    #[error("{}: there are no points{}; a body is fitted around at least 4", path.display(), left(*dropped))]
    Empty {
        /// The file.
        path: PathBuf,
        /// How many points with coordinates that are not finite were left out.
        dropped: usize,
    },
}

fn left(dropped: usize) -> String {
    if dropped == 0 { String::new() } else { format!(" left but {dropped} with coordinates that are not finite") }
}

/// What a reader of one format found wrong, without the file's name.
#[derive(Debug, PartialEq)]
pub(crate) struct Defect {
    pub(super) place: String,
    pub(super) reason: String,
    pub(super) remedy: &'static str,
}

impl Defect {
    /// The remedy where no better one is known.
    pub(super) const DAMAGED: &str = "the file is truncated or damaged, export it again";

    pub(super) fn new(place: impl Into<String>, reason: impl Into<String>) -> Self {
        Self { place: place.into(), reason: reason.into(), remedy: Self::DAMAGED }
    }

    /// A defect in a line, counted from 1.
    pub(super) fn line(number: usize, reason: impl Into<String>) -> Self {
        Self::new(format!("line {number}"), reason)
    }

    /// The same with another remedy.
    pub(super) fn remedy(self, remedy: &'static str) -> Self {
        Self { remedy, ..self }
    }
}
