//! Why the demo stops, and files that name themselves where they cannot be written.

use std::io;
use std::path::{Path, PathBuf};

/// Why the demo stopped.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// A file or folder cannot be read or written.
    #[error("cannot use {}: {source}; choose another folder with --out", .path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The tables cannot be printed.
    #[error("cannot print: {0}")]
    Print(#[from] io::Error),
    /// A shape cannot be fitted, or its body is not proven.
    #[error("no degree-{degree} body for the {name}: {why}")]
    Fit {
        /// Name of the shape.
        name: String,
        /// Degree asked for.
        degree: usize,
        /// The reason.
        why: String,
    },
    /// The server does not start or does not answer.
    #[error("{step}: {why}")]
    Server {
        /// What was being done.
        step: &'static str,
        /// The reason.
        why: String,
    },
    /// A plot cannot be drawn.
    #[error(transparent)]
    Chart(#[from] crate::draw::ChartError),
}

pub(super) fn write(path: &Path, content: &str) -> Result<PathBuf, DemoError> {
    std::fs::write(path, content).map_err(|source| DemoError::File { path: path.into(), source })?;
    Ok(path.into())
}
