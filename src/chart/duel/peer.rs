//! Programs that answer for other libraries, in processes of their own.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Why such a program has no say.
#[derive(Debug, thiserror::Error)]
pub enum PeerError {
    /// The variable names no program.
    #[error("{variable}: {} is no file; name {what}, or unset the variable", path.display())]
    NoProgram {
        /// The variable.
        variable: &'static str,
        /// What it says.
        path: PathBuf,
        /// What it should name.
        what: &'static str,
    },
    /// A file could not be read or written, or the program not be started.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or program.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The program failed, or said what it should not.
    #[error("{}: {reason}", program.display())]
    Program {
        /// The program.
        program: PathBuf,
        /// What it said, or what is wrong with that.
        reason: String,
    },
}

impl PeerError {
    pub(in crate::chart) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        |source| Self::Io { path, source }
    }

    pub(in crate::chart) fn program(program: &Path, reason: impl ToString) -> Self {
        Self::Program { program: program.to_owned(), reason: reason.to_string() }
    }
}

/// The program that a variable names; none where it is not set.
///
/// # Errors
/// [`PeerError::NoProgram`].
pub(in crate::chart) fn named(variable: &'static str, what: &'static str) -> Result<Option<PathBuf>, PeerError> {
    let Some(path) = std::env::var_os(variable).map(PathBuf::from) else { return Ok(None) };
    if path.is_file() { Ok(Some(path)) } else { Err(PeerError::NoProgram { variable, path, what }) }
}

/// What a program prints, if it ends well.
///
/// # Errors
/// [`PeerError::Io`] or [`PeerError::Program`].
pub(in crate::chart) fn printed(program: &Path, command: &mut Command) -> Result<Vec<u8>, PeerError> {
    let output = command.output().map_err(PeerError::io(program))?;
    if output.status.success() {
        return Ok(output.stdout);
    }
    Err(PeerError::program(program, format!("failed: {}", String::from_utf8_lossy(&output.stderr).trim())))
}
