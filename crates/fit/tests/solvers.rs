//! Both solvers of a fit's program: the same optimum and the same volume, on every mesh of the data
//! and around clouds that are hard on either.

use std::ops::ControlFlow;
use std::path::PathBuf;

use nalgebra::Vector3;
use sublevel_fit::{Fit, FitError, FitOptions, Solver, fit, read_mesh};
use sublevel_testkit::catalogue::clouds::{DRAWN_KINDS, Must, drawn};
use sublevel_testkit::random::few_or;
use sublevel_testkit::{Seeded, data};

fn by(solver: Solver, degree: usize, points: &[Vector3<f64>]) -> Result<Fit, FitError> {
    let options = FitOptions { degree, solver: Some(solver), ..FitOptions::default() };
    fit("test", points, &options, &mut |_| ControlFlow::Continue(()))
}

/// Meshes of the data.
fn meshes() -> Vec<PathBuf> {
    let files = ["meshes", "psb"].map(|folder| std::fs::read_dir(data(folder)).expect("a folder of meshes"));
    let mut paths: Vec<PathBuf> = files.into_iter().flatten().map(|entry| entry.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "off"));
    paths.sort();
    assert!(paths.len() > 15, "{paths:?}");
    paths
}

fn both_agree(paths: &[PathBuf], degree: usize) {
    for path in paths {
        let mesh = read_mesh(path, &Default::default()).expect("a mesh").mesh;
        let [structured, clarabel] = [Solver::Structured, Solver::Clarabel].map(|solver| {
            let made = by(solver, degree, &mesh.points).unwrap_or_else(|error| panic!("{solver} {path:?}: {error}"));
            assert_eq!(made.body.provenance().expect("fitted").solver, Some(solver));
            assert_eq!((made.report.solver, &made.report.fallback), (solver, &None));
            assert_eq!(made.report.log.is_empty(), solver == Solver::Structured);
            made.report
        });
        let objective = clarabel.objective_value - structured.objective_value;
        let volume = clarabel.volume_m3 / structured.volume_m3 - 1.0;
        println!(
            "degree {degree}, {}: objective {:.6}, by clarabel {objective:+.1e}, volume {volume:+.1e}, {:.2} and {:.2} s",
            path.display(),
            structured.objective_value,
            structured.seconds,
            clarabel.seconds
        );
        let most = if degree < 8 { 1e-5 } else { 1e-4 };
        assert!(objective.abs() < most && volume.abs() < most);
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn both_solvers_agree() {
    for degree in [2, 4, 6] {
        both_agree(&meshes(), degree);
    }
}

/// A quarter of a minute each.
#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn both_solvers_agree_at_degree_eight() {
    let all = std::env::var_os("SUBLEVEL_LONG").is_some();
    both_agree(&meshes()[..if all { 19 } else { 1 }], 8);
}

/// The points of a torus lie on a quartic, so that their moment matrix is singular at degree 8
/// whatever their weights.
#[test]
fn points_on_a_quartic_are_fitted_by_both() {
    let turn = |k: usize, of: usize| std::f64::consts::TAU * k as f64 / of as f64;
    let at = |u: f64, v: f64| Vector3::new((2.0 + v.cos()) * u.cos(), (2.0 + v.cos()) * u.sin(), v.sin());
    let points: Vec<_> = (0..20).flat_map(|i| (0..12).map(move |j| at(turn(i, 20), turn(j, 12)))).collect();
    let [structured, clarabel] = [Solver::Structured, Solver::Clarabel].map(|solver| {
        let made = by(solver, 8, &points).unwrap_or_else(|error| panic!("{solver}: {error}"));
        made.body.prove_contains(&points).expect("proven");
        made.report
    });
    let (objective, volume) =
        (clarabel.objective_value - structured.objective_value, clarabel.volume_m3 / structured.volume_m3 - 1.0);
    assert!(objective.abs() < 1e-4 && volume.abs() < 1e-4, "{objective:e} {volume:e}");
}

/// The catalogue's kinds of degenerate clouds: a body, or an error that names what is wrong.
#[test]
fn degenerate_clouds_are_certified_or_refused_by_name() {
    let [mut fitted, mut refused] = [0; 2];
    let count = few_or(70, 200);
    for seed in 0..count {
        let mut random = Seeded(seed);
        let (name, points, must) = drawn(seed % DRAWN_KINDS, &mut random);
        let degree = [2, 4, 6][random.index(3)];
        for solver in [Some(Solver::Structured), Some(Solver::Clarabel), None] {
            let options = FitOptions { degree, solver, ..FitOptions::default() };
            match fit("test", &points, &options, &mut |_| ControlFlow::Continue(())) {
                Ok(made) => {
                    assert_ne!(must, Must::Refuse, "seed {seed}, {name}");
                    made.body.prove_contains(&points).expect("proven");
                    fitted += 1;
                }
                Err(
                    FitError::TooFewPoints(_) | FitError::Hull(_) | FitError::OutOfRange(_) | FitError::NotFinite(_),
                ) => {
                    assert_ne!(must, Must::Fit, "seed {seed}, {name}, {solver:?}");
                    refused += 1;
                }
                // One of them alone need not solve every program.
                Err(FitError::Unsolved(_) | FitError::Unproven(_)) if solver.is_some() => {
                    println!("seed {seed}, {name}, degree {degree}: not by {solver:?}");
                }
                Err(error) => assert_eq!(must, Must::Decide, "seed {seed}, {name}, {solver:?}: {error}"),
            }
        }
    }
    println!("{fitted} fitted, {refused} refused");
    assert!(fitted > 5 * count / 4 && refused > count / 10);
}
