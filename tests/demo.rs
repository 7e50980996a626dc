//! The demo as a user runs it: fits, serves, sweeps, draws.
#![cfg(feature = "fit")]

use std::process::Command;

#[test]
fn the_demo_sweeps_a_chair_through_a_human() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("new").join("demo");
    let demo = Command::new(env!("CARGO_BIN_EXE_sublevel")).arg("demo").arg("--out").arg(&out).output().unwrap();
    let text = String::from_utf8(demo.stdout).unwrap();
    assert!(demo.status.success(), "{text}\n{}", String::from_utf8_lossy(&demo.stderr));
    for word in ["chair", "human", "apart", "overlapping", "passes 1", "silhouettes.svg"] {
        assert!(text.contains(word), "{word} is missing in\n{text}");
    }
    // Every file it names is there.
    let (_, files) = text.split_once("Written:").unwrap();
    assert_eq!(files.split_whitespace().filter(|file| std::path::Path::new(file).is_file()).count(), 11, "{files}");

    let csv = std::fs::read_to_string(out.join("sweep.csv")).unwrap();
    let rows: Vec<Vec<f64>> =
        csv.lines().skip(1).map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 61);
    for row in &rows {
        let [distance_lower, distance_upper] = [row[2], row[3]];
        for [value, lower, upper] in [[row[4], row[5], row[6]], [row[7], row[8], row[9]]] {
            assert!(lower <= value && value <= upper && upper - lower <= 1e-9 * value.abs().max(1.0), "{row:?}");
            // The measures tell one story: apart in distance is above level 1, overlapping is
            // below.
            assert!(!(distance_lower > 0.0 && upper < 1.0), "{row:?}");
            assert!(!(distance_upper == 0.0 && lower > 1.0), "{row:?}");
        }
    }
    let levels = |row: &[f64]| [row[4], row[7]];
    assert!(levels(&rows[0]).iter().chain(&levels(&rows[60])).all(|level| *level > 1.0), "apart at both ends");
    assert!(levels(&rows[30]).iter().all(|level| *level < 1.0), "overlapping in the middle");
}
