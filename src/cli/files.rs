//! Files that commands read and write, named in the errors.

use crate::body::{Obstacle, Shape};
use crate::scene::{Geometry, GeometryFileError};
use std::error::Error;
use std::path::Path;

/// Reads a text file.
///
/// # Errors
/// What the system said, with the file's name and the remedy.
pub fn read(path: &Path) -> Result<String, Box<dyn Error>> {
    std::fs::read_to_string(path).map_err(|error| format!("{}: {error}; check the path", path.display()).into())
}

/// Reads and re-proves the file of a body or an sos-body, naming it in the error.
pub(super) fn read_obstacle(path: &Path) -> Result<Obstacle, Box<dyn Error>> {
    Obstacle::from_json(&read(path)?).map_err(|error| format!("{}: {error}", path.display()).into())
}

/// Reads and re-proves the file of a body or a compound, naming it in the error.
pub(super) fn read_shape(path: &Path) -> Result<Shape, Box<dyn Error>> {
    Shape::from_json(&read(path)?).map_err(|error| format!("{}: {error}", path.display()).into())
}

/// Reads and re-proves the file of anything that a scene can contain, naming it in the error.
pub(super) fn read_geometry(path: &Path) -> Result<Geometry, Box<dyn Error>> {
    Geometry::from_json(&read(path)?).map_err(|error| {
        let remedy = match error {
            GeometryFileError::Json(_) => "; write it with 'sublevel fit' or 'sublevel primitive'",
            _ => "",
        };
        format!("{}: {error}{remedy}", path.display()).into()
    })
}

/// Writes a file whole or not at all: under a temporary name beside it, then renamed.
///
/// # Errors
/// What the system said, with the file's name and the remedy.
pub fn write_atomically(path: &Path, content: &str) -> Result<(), Box<dyn Error>> {
    use std::io::Write;
    let failed =
        |error: std::io::Error| format!("cannot write {}: {error}; check the folder and its space", path.display());
    let mut name = path.file_name().ok_or_else(|| format!("{} names no file", path.display()))?.to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = path.with_file_name(name);
    let written = std::fs::File::create(&temporary)
        .and_then(|mut file| file.write_all(content.as_bytes()).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&temporary, path));
    if let Err(error) = written {
        // What is left of the attempt only takes space.
        let _ = std::fs::remove_file(&temporary);
        return Err(failed(error).into());
    }
    Ok(())
}

/// Makes the output folder.
#[cfg(feature = "fit")]
pub(super) fn make_folder(path: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(path)
        .map_err(|error| format!("cannot make {}: {error}; choose another --out", path.display()).into())
}
