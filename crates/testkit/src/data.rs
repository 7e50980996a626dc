//! Meshes and scenes that are not part of the project.

use std::path::PathBuf;

/// A file or folder of the test data. Tests that need it are ignored unless asked for, with this
/// reason: `needs SUBLEVEL_DATA`.
///
/// # Panics
/// Where `SUBLEVEL_DATA` does not name the folder.
pub fn data(path: &str) -> PathBuf {
    let folder = std::env::var_os("SUBLEVEL_DATA").expect("SUBLEVEL_DATA names the folder with meshes and scenes");
    PathBuf::from(folder).join(path)
}
