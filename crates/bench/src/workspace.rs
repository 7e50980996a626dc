//! The folder that relative paths of benches are about.

use std::path::Path;
use std::{env, io};

/// Makes the root of the workspace the current folder. Cargo starts benches in the folder of their
/// package, where `docs/measures.csv` would not name the file that its user meant.
///
/// # Errors
/// The sources are no longer where they were compiled.
pub fn enter_workspace() -> io::Result<()> {
    env::set_current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
}
