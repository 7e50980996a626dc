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
    /// A signal or a panic ended the program.
    #[error("{} crashed: {reason}", program.display())]
    Crashed {
        /// The program.
        program: PathBuf,
        /// How it ended, and what it said.
        reason: String,
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
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        |source| Self::Io { path, source }
    }

    pub(crate) fn program(program: &Path, reason: impl ToString) -> Self {
        Self::Program { program: program.to_owned(), reason: reason.to_string() }
    }
}

/// The program that a variable names; none where it is not set.
///
/// # Errors
/// [`PeerError::NoProgram`].
pub(crate) fn named(variable: &'static str, what: &'static str) -> Result<Option<PathBuf>, PeerError> {
    let Some(path) = std::env::var_os(variable).map(PathBuf::from) else { return Ok(None) };
    if path.is_file() { Ok(Some(path)) } else { Err(PeerError::NoProgram { variable, path, what }) }
}

/// What a Rust program exits with after a panic.
const PANICKED: i32 = 101;

/// What a program prints, if it ends well.
///
/// # Errors
/// [`PeerError::Io`], [`PeerError::Crashed`] or [`PeerError::Program`].
pub(crate) fn printed(program: &Path, command: &mut Command) -> Result<Vec<u8>, PeerError> {
    let output = command.output().map_err(PeerError::io(program))?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    match output.status.code() {
        Some(0) => Ok(output.stdout),
        // Ended by a signal, it has no code.
        None | Some(PANICKED) => Err(PeerError::Crashed {
            program: program.to_owned(),
            reason: format!("{}; {}", output.status, stderr.trim()),
        }),
        Some(_) => Err(PeerError::program(program, format!("failed: {}", stderr.trim()))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crashes_are_distinguished_from_refusals() {
        let shell = Path::new("/bin/sh");
        let run = |script: &str| printed(shell, Command::new(shell).args(["-c", script]));
        assert_eq!(run("echo fine").unwrap(), b"fine\n");
        for crash in ["kill -ABRT $$", "echo index out of bounds >&2; exit 101"] {
            assert!(matches!(run(crash), Err(PeerError::Crashed { .. })), "{crash}");
        }
        let refused = run("echo no such file >&2; exit 1").unwrap_err();
        assert!(matches!(&refused, PeerError::Program { reason, .. } if reason.contains("no such file")), "{refused}");
    }
}
