//! Why there are no settings.

use std::path::PathBuf;

/// Why there are no settings.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file is not there or cannot be read.
    #[error("{}: {source}; name the file of settings with --config", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// An unknown key, or a value of another kind.
    #[error("{0}")]
    Source(String),
    /// A value that cannot be used, or not along with others.
    #[error("{key} {why}")]
    Setting {
        /// The key, with its table.
        key: String,
        /// The reason and the remedy.
        why: String,
    },
}
