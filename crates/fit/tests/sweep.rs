//! Fits of every mesh of the test data and of clouds of points that break fits: a proven body, or
//! an error with the reason. Where one solver is tested (`make solvers`) every mesh becomes a body
//! and a compound, else one of the two; and there are twice as many clouds.

use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use sublevel_core::body::{Body, Compound, Covered};
use sublevel_fit::{
    Fit, FitError, FitOptions, HullError, Progress, ReadOptions, fit, fit_parts, read_mesh, thicken, trim,
};
use sublevel_testkit::catalogue::clouds::{DRAWN_KINDS, Must, drawn, rounded_box};
use sublevel_testkit::{Seeded, data, solver_under_test};

/// A fit of a few hundred points that takes more steps goes on for ever.
const MOST_STEPS: u32 = 100_000;

/// Stops a fit that does not end, which then fails as cancelled.
fn patient() -> impl FnMut(Progress) -> ControlFlow<()> {
    let mut steps = 0;
    move |_| {
        steps += 1;
        if steps > MOST_STEPS { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

fn fitted(points: &[Vector3<f64>], degree: usize) -> Result<Fit, FitError> {
    let options = FitOptions { degree, solver: solver_under_test(), ..FitOptions::default() };
    fit("cloud", points, &options, &mut patient())
}

/// What its file says alone proves that a body contains the points.
fn prove(fit: &Fit, points: &[Vector3<f64>], what: &str) {
    let again = Body::from_json(&fit.body.to_json()).unwrap_or_else(|error| panic!("{what}: {error}"));
    again.prove_contains(points).unwrap_or_else(|error| panic!("{what}: {error}"));
    let report = &fit.report;
    let (volume, hull) = (report.volume_m3 + report.volume_error_m3, report.hull_volume_m3);
    assert!(volume >= hull * (1.0 - 1e-6), "{what}: {volume} m³ around a hull of {hull}");
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("SUBLEVEL_DATA is readable").map(|entry| entry.unwrap().path()) {
        match entry.extension().and_then(|extension| extension.to_str()) {
            // Those have tests of their own.
            _ if entry.ends_with("faults") => {}
            _ if entry.is_dir() => files(&entry, found),
            Some("off" | "obj" | "ply" | "stl") => found.push(entry),
            _ => {}
        }
    }
}

/// The mesh files of the test data in order: every other one from this on, or all.
fn meshes(first: usize) -> Vec<PathBuf> {
    let mut found = Vec::new();
    files(&data(""), &mut found);
    found.sort();
    assert!(found.len() >= 29, "{} meshes in SUBLEVEL_DATA", found.len());
    if solver_under_test().is_some() { found } else { found.into_iter().skip(first).step_by(2).collect() }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn every_mesh_becomes_a_body() {
    for path in meshes(0) {
        let mesh = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
        for degree in [2, 4, 6] {
            let what = format!("{}, degree {degree}", path.display());
            let fit = fitted(&mesh.points, degree).unwrap_or_else(|error| panic!("{what}: {error}"));
            println!(
                "{what}: {:.2} s, volume over hull {:.3}",
                fit.report.seconds,
                fit.report.volume_m3 / fit.report.hull_volume_m3
            );
            prove(&fit, &mesh.points, &what);
        }
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn every_mesh_becomes_a_compound() {
    for path in meshes(1) {
        let what = path.display();
        let mesh = read_mesh(&path, &ReadOptions::default()).unwrap().mesh;
        let options = FitOptions { degree: 4, solver: solver_under_test(), ..FitOptions::default() };
        let compound = fit_parts("mesh", &mesh, 4, &options, &mut patient())
            .unwrap_or_else(|error| panic!("{what}: {error}"))
            .compound;
        let again = Compound::from_json(&compound.to_json()).unwrap_or_else(|error| panic!("{what}: {error}"));
        let covering = again.covering().expect("fits note what they cover");
        let (covered, most) = again
            .prove_covers(&mesh.points, &mesh.triangles, &covering.division)
            .unwrap_or_else(|error| panic!("{what}: {error}"));
        println!("{what}: {} parts, {covered:?}, volume {:.4e} m³", again.parts().len(), again.volume().volume_m3);
        assert!(covered == covering.proven && most <= 1.0, "{what}");
        let closed = ["10.off", "101.off", "spot.off", "torus.off", "hand_closed.off"];
        let closed = path.file_name().is_some_and(|name| closed.iter().any(|known| name == *known));
        assert!(!closed || covered == Covered::Interior, "{what} is closed");
    }
}

/// The cloud of a seed; every kind in turn.
fn cloud(seed: u64) -> (&'static str, Vec<Vector3<f64>>, Must) {
    drawn(seed % DRAWN_KINDS, &mut Seeded(seed))
}

/// The clouds of fifty seeds from this on, or of half of them.
fn clouds(first: u64) {
    let count = if solver_under_test().is_some() { 50 } else { 25 };
    let mut bodies = 0;
    for seed in first..first + count {
        let (kind, points, must) = cloud(seed);
        // Every degree meets every kind.
        let degree = [2, 4, 6, 2, 4, 8][(seed / DRAWN_KINDS % 6) as usize];
        let what = format!("seed {seed}, {kind}, {} points, degree {degree}", points.len());
        match fitted(&points, degree) {
            Ok(fit) => {
                prove(&fit, &points, &what);
                bodies += 1;
                assert!(!matches!(must, Must::Refuse), "{what}: was fitted");
            }
            Err(error) => {
                println!("{what}: {error}");
                assert_ne!(error, FitError::Cancelled, "{what} hangs");
                if matches!(must, Must::Fit) {
                    // One solver alone may say that it fails, where the other one takes over.
                    let says_so = matches!(&error, FitError::Unsolved(why) if why.is_solver_fixed);
                    assert!(says_so, "{what}: {error}");
                    let options = FitOptions { degree, ..FitOptions::default() };
                    let fit = fit("cloud", &points, &options, &mut patient());
                    prove(&fit.unwrap_or_else(|error| panic!("{what}: {error}")), &points, &what);
                    bodies += 1;
                }
                if matches!(must, Must::Refuse) {
                    let reason = matches!(error, FitError::TooFewPoints(_) | FitError::Hull(HullError::Flat { .. }));
                    assert!(reason, "{what}: {error}");
                }
            }
        }
    }
    println!("{bodies} bodies of {count} clouds");
    assert!(bodies > 0);
}

#[test]
fn family_26_first_quarter() {
    clouds(0);
}

#[test]
fn family_26_second_quarter() {
    clouds(50);
}

#[test]
fn family_26_third_quarter() {
    clouds(100);
}

#[test]
fn family_26_fourth_quarter() {
    clouds(150);
}

#[test]
fn family_26_remedies_work() {
    for seed in 0..20 {
        // What the errors advise: a thickness for flat points, trimming for outliers.
        let (_, flat, _) = cloud(DRAWN_KINDS * seed);
        let thick = thicken(&flat, 1e-3);
        prove(&fitted(&thick, 4).unwrap_or_else(|error| panic!("seed {seed}: {error}")), &flat, "thickened");

        let (_, outliers, _) = cloud(DRAWN_KINDS * seed + 7);
        let fraction = 5.5 / outliers.len() as f64;
        let trimmed = trim(&outliers, fraction, &mut patient()).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        let fit = fitted(&trimmed.kept, 4).unwrap_or_else(|error| panic!("seed {seed}: {error}"));
        prove(&fit, &trimmed.kept, "trimmed");
        assert!(
            trimmed.farthest_m > 1.0,
            "seed {seed}: the outliers are among the {} left out",
            trimmed.left_out.len()
        );
        assert!(fit.body.circumscribed().radius < 5.0, "seed {seed}: {}", fit.body.circumscribed().radius);
    }
}

#[test]
fn family_26_a_million_points() {
    let points = rounded_box(&mut Seeded(26));
    let fit = fitted(&points, 4).unwrap();
    println!("{:.2} s, volume over hull {:.4}", fit.report.seconds, fit.report.volume_m3 / fit.report.hull_volume_m3);
    prove(&fit, &points, "a million points");
}
