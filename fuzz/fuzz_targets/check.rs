//! What holds of every content of every format.

use std::path::Path;
use sublevel_fit::{ReadOptions, parse_mesh};

/// Reads the content: a mesh whose numbers are finite and whose triangles name its points, or an
/// error of one line that says where it is and what to do.
pub fn check(bytes: &[u8], format: &str) {
    for drop in [false, true] {
        let options = ReadOptions { drop_nan: drop, drop_unused: drop, ..ReadOptions::default() };
        match parse_mesh(bytes, format, Path::new("input"), &options) {
            Ok(reading) => {
                let mesh = reading.mesh;
                assert!(mesh.points.iter().flatten().all(|value| value.is_finite()));
                assert!(mesh.triangles.iter().flatten().all(|&corner| corner < mesh.points.len()));
            }
            Err(error) => {
                let text = error.to_string();
                assert!(text.starts_with("input") && !text.contains('\n') && text.len() < 1000, "{text}");
            }
        }
    }
}
