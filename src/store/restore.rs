//! A catalogue out of a backup.

use std::fs::{self, File};
use std::io;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use super::disk::FILE;
use super::{Catalogue, Counts, Store, StoreError};

/// Makes the catalogue of a directory out of a backup: everything in it is read and proven first,
/// so that a directory holds all of it or is as it was. Returns how many bodies and scenes there
/// are.
///
/// # Errors
/// A directory that has a catalogue, a file that is no backup or is not valid, and a disk that
/// fails.
pub fn restore(backup: &Path, dir: &Path) -> Result<Counts, StoreError> {
    let unusable = |source: io::Error| StoreError::Directory { dir: dir.into(), source };
    let file = dir.join(FILE);
    if file.try_exists().map_err(unusable)? {
        return Err(StoreError::Occupied { file });
    }
    let made_dir = !dir.try_exists().map_err(unusable)?;
    fs::create_dir_all(dir).map_err(unusable)?;
    let aside = tempfile::Builder::new().prefix("restoring-").tempdir_in(dir).map_err(unusable)?;
    let proven = prove(backup, aside.path()).and_then(|counts| {
        // A link, unlike a renaming, never takes the place of what a server has made meanwhile.
        fs::hard_link(aside.path().join(FILE), &file).map_err(|error| match error.kind() {
            io::ErrorKind::AlreadyExists => StoreError::Occupied { file: file.clone() },
            _ => unusable(error),
        })?;
        File::open(dir).and_then(|dir| dir.sync_all()).map_err(unusable)?;
        Ok(counts)
    });
    if proven.is_err() && made_dir {
        drop(aside);
        // Empty, unless somebody else uses it meanwhile.
        let _ = fs::remove_dir(dir);
    }
    proven
}

fn prove(backup: &Path, aside: &Path) -> Result<Counts, StoreError> {
    let copy = aside.join(FILE);
    let copied = fs::copy(backup, &copy).and_then(|_| File::open(&copy)?.sync_all());
    copied.map_err(|source| StoreError::Directory { dir: backup.into(), source })?;
    let loaded = Store::open(aside).and_then(Catalogue::load);
    // The folder that it was looked at in says nothing.
    let named = |error| match error {
        StoreError::Damaged { what, .. } => StoreError::damaged(backup, what),
        StoreError::Format { found, expected, .. } => StoreError::Format { dir: backup.into(), found, expected },
        StoreError::Empty { .. } => StoreError::Empty { file: backup.into() },
        other => other,
    };
    let catalogue = loaded.map_err(named)?;
    catalogue.prove_all(&AtomicBool::new(false));
    match catalogue.damage().first() {
        Some(damage) => Err(StoreError::damaged(backup, damage.to_string())),
        None => Ok(catalogue.counts()),
    }
}
