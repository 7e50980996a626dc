//! What can go wrong between memory and disk.

use std::io;
use std::path::{Path, PathBuf};

/// Why the catalogue's file cannot be opened, read or written. Nothing was changed.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Another process holds the file's lock.
    #[error(
        "the data directory {} is in use by another server; stop that server or give this one another directory",
        .dir.display()
    )]
    InUse {
        /// The data directory.
        dir: PathBuf,
    },
    /// The data directory cannot be made or opened.
    #[error(
        "cannot use the data directory {}: {source}; check the path and its permissions",
        .dir.display()
    )]
    Directory {
        /// The data directory.
        dir: PathBuf,
        /// The reason.
        source: io::Error,
    },
    /// A newer or older version of the program wrote the file.
    #[error(
        "the catalogue in {} has format {found}, this program reads format {expected}; use the version that wrote it, or \
         another directory, into which bodies can be pushed again",
        .dir.display()
    )]
    Format {
        /// The data directory.
        dir: PathBuf,
        /// What the file says.
        found: u64,
        /// What this program reads and writes.
        expected: u64,
    },
    /// A catalogue where a backup is to be restored.
    #[error("{} is there already; restore into another directory, or move it away first", .file.display())]
    Occupied {
        /// The catalogue's file.
        file: PathBuf,
    },
    /// The file is there and is empty: it was cut, or the first start did not get far.
    #[error(
        "{} is empty; restore it from a backup, or remove it to start with an empty catalogue",
        .file.display()
    )]
    Empty {
        /// The catalogue's file.
        file: PathBuf,
    },
    /// The file contains something this program did not write.
    #[error(
        "the catalogue in {} is damaged: {what}; restore catalogue.redb from a backup or use another directory",
        .dir.display()
    )]
    Damaged {
        /// The data directory.
        dir: PathBuf,
        /// The damage.
        what: String,
    },
    /// The disk or quota is used up.
    #[error("no space left for the catalogue in {}: {source}; free some and repeat the call", .dir.display())]
    Full {
        /// The data directory.
        dir: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Any other failure of the disk or the database.
    #[error("cannot read or write the catalogue in {}: {source}; check the disk", .dir.display())]
    Disk {
        /// The data directory.
        dir: PathBuf,
        /// What the database said.
        source: Box<redb::Error>,
    },
}

impl StoreError {
    pub(super) fn damaged(dir: &Path, what: impl Into<String>) -> Self {
        Self::Damaged { dir: dir.into(), what: what.into() }
    }

    pub(super) fn from_redb(dir: &Path, error: impl Into<redb::Error>) -> Self {
        let dir = dir.to_path_buf();
        match error.into() {
            redb::Error::DatabaseAlreadyOpen => Self::InUse { dir },
            redb::Error::Io(source) => match source.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge => {
                    Self::Full { dir, source }
                }
                io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof => {
                    Self::Damaged { dir, what: source.to_string() }
                }
                io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                    Self::Directory { dir, source }
                }
                _ => Self::Disk { dir, source: Box::new(redb::Error::Io(source)) },
            },
            error @ (redb::Error::Corrupted(_)
            | redb::Error::TableTypeMismatch { .. }
            | redb::Error::TableIsMultimap(_)
            | redb::Error::TableIsNotMultimap(_)
            | redb::Error::TypeDefinitionChanged { .. }) => Self::Damaged { dir, what: error.to_string() },
            error => Self::Disk { dir, source: Box::new(error) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_failure_of_the_system_has_its_remedy() {
        use io::ErrorKind;
        for (kind, remedy) in [
            (ErrorKind::PermissionDenied, "permissions"),
            (ErrorKind::ReadOnlyFilesystem, "permissions"),
            (ErrorKind::NotFound, "check the path"),
            (ErrorKind::StorageFull, "free some"),
            (ErrorKind::UnexpectedEof, "backup"),
            (ErrorKind::Other, "check the disk"),
        ] {
            let error = StoreError::from_redb(Path::new("data"), redb::Error::Io(kind.into())).to_string();
            assert!(error.contains(remedy) && error.contains("data"), "{kind}: {error}");
        }
    }
}
