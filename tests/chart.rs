//! The reports of `sublevel chart`, as a reader gets them.

#![cfg(feature = "chart")]

use std::path::PathBuf;
use std::process::Command;

/// Rows with volumes known independently for human, chair, hand, vase and octopus, and how far above them an answer may be: exact
/// geometry either way, fits only above.
const KNOWN: [(&str, [f64; 5], f64); 6] = [
    ("convex hull", [0.2936, 0.6558, 0.3627, 0.9088, 0.4993], 5e-4),
    ("smallest ball", [3.730, 3.742, 3.848, 3.912, 4.096], 1e-3),
    ("axis-aligned box", [0.697, 1.009, 1.222, 2.048, 1.645], 1e-3),
    ("smallest oriented box", [0.588, 0.998, 0.806, 1.726, 1.277], 1e-3),
    ("sos-convex 2, logdet-p", [0.5894, 1.8425, 0.8530, 1.2252, 1.3558], 3e-3),
    ("sos-convex 4, logdet-p", [0.4553, 1.2200, 0.5453, 1.1186, 0.8971], 3e-3),
];

#[test]
fn the_quick_table_holds_the_known_volumes() {
    let Some(data) = std::env::var_os("SUBLEVEL_DATA").map(PathBuf::from) else {
        eprintln!("skipped: SUBLEVEL_DATA does not name the folder with the meshes");
        return;
    };
    let out = tempfile::tempdir().expect("a folder can be made");
    let output = Command::new(env!("CARGO_BIN_EXE_sublevel"))
        .args(["chart", "table1", "--quick", "--meshes"])
        .arg(data.join("psb"))
        .arg("--out")
        .arg(out.path())
        .output()
        .expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |name: &str| std::fs::read_to_string(out.path().join(name)).expect("the file is written");
    let csv = read("table1.csv");
    for (row, volumes, above) in KNOWN {
        let line = format!("\"{row}\",");
        let found: Vec<f64> =
            csv.lines().filter_map(|text| text.strip_prefix(&line)?.split(',').nth(1)?.parse().ok()).collect();
        assert_eq!(found.len(), volumes.len(), "{row}: {found:?}");
        for (volume, known) in found.into_iter().zip(volumes) {
            assert!((-2e-3..=above).contains(&(volume / known - 1.0)), "{row}: {volume} m³ where {known} are known");
        }
    }
    let report = read("table1.md");
    for name in ["table1.svg", "table1-degrees.svg", "table1-gram.svg", "table1-convexity.svg", "table1-levels.svg"] {
        assert!(report.contains(name), "{name} is not in the report");
        let picture = read(name);
        assert!(picture.starts_with("<svg") && !picture.contains("NaN"), "{name}");
    }
}

#[test]
fn missing_meshes_are_told() {
    let out = tempfile::tempdir().expect("a folder can be made");
    let folder = out.path().to_str().expect("a plain name");
    let output = Command::new(env!("CARGO_BIN_EXE_sublevel"))
        .args(["chart", "table1", "--meshes", folder, "--out", folder])
        .output()
        .expect("the program starts");
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{error}");
    assert!(error.contains("10.off") && error.contains("Princeton"), "{error}");
}
