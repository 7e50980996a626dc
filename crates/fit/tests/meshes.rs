//! The fits of the five meshes of the paper's Table I, against independently computed optima.

use std::ops::ControlFlow;
use sublevel_core::body::Body;
use sublevel_fit::{FitOptions, ReadOptions, RefinementEnd, fit, read_mesh};
use sublevel_testkit::{data, solver_under_test};

/// Mesh number, volume of the convex hull and vertices of it, volumes of the -log det P fits at
/// degrees 2, 4, 6.
const TABLE: [(u32, f64, usize, [f64; 3]); 5] = [
    (10, 0.2936, 364, [0.5894, 0.4553, 0.3911]),
    (101, 0.6558, 320, [1.8425, 1.2200, 0.9665]),
    (181, 0.3627, 651, [0.8530, 0.5453, 0.4531]),
    (361, 0.9088, 1443, [1.2252, 1.1186, 1.0372]),
    (121, 0.4993, 414, [1.3558, 0.8971, 0.7004]),
];

fn check(row: usize) {
    let (number, hull_volume, hull_vertices, volumes) = TABLE[row];
    let path = data(&format!("psb/{number}.off"));
    let points = read_mesh(&path, &ReadOptions::default()).expect("the mesh is readable").mesh.points;
    for (degree, expected) in [2, 4, 6].into_iter().zip(volumes) {
        let options = FitOptions { degree, solver: solver_under_test(), ..FitOptions::default() };
        let fit = fit("mesh", &points, &options, &mut |_| ControlFlow::Continue(())).expect("the mesh is fitted");
        let report = &fit.report;
        println!(
            "{number}: degree {degree}, volume {:.4} m³ ({:+.2} %), {:.2} s, {} rounds, {} iterations, gap {:.0e}",
            report.volume_m3,
            100.0 * (report.volume_m3 / expected - 1.0),
            report.seconds,
            report.rounds,
            report.iterations,
            report.optimality_gap.unwrap_or(f64::NAN),
        );
        assert!(report.volume_m3 <= 1.003 * expected, "{} m³ where {expected} are possible", report.volume_m3);
        assert!((report.hull_volume_m3 / hull_volume - 1.0).abs() < 5e-4, "{}", report.hull_volume_m3);
        assert!(report.hull_vertices.abs_diff(hull_vertices) <= 3, "{}", report.hull_vertices);
        assert!(report.optimality_gap.unwrap().abs() <= 1e-5 * report.objective_value.abs().max(1.0));
        // Reading a body back proves it sos-convex and bounded from its stored numbers alone.
        let again = Body::from_json(&fit.body.to_json()).expect("the stored body is proven");
        assert_eq!(again.id(), fit.body.id());
        again.prove_contains(&points).expect("every point of the mesh is proven inside");
    }
}

/// Volumes after refinement that an independent program reached at degrees 4 and 6, in the order of
/// the table.
const REFINED: [[f64; 2]; 5] =
    [[0.4414, 0.3823], [1.1671, 0.9331], [0.5088, 0.4357], [1.0947, 1.0233], [0.8134, 0.6396]];

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn refined_volumes() {
    for ((number, ..), volumes) in TABLE.into_iter().zip(REFINED) {
        let path = data(&format!("psb/{number}.off"));
        let points = read_mesh(&path, &ReadOptions::default()).expect("the mesh is readable").mesh.points;
        for (degree, expected) in [4, 6].into_iter().zip(volumes) {
            let options = FitOptions { degree, refine: true, solver: solver_under_test(), ..FitOptions::default() };
            let fit = fit("mesh", &points, &options, &mut |_| ControlFlow::Continue(())).expect("the mesh is fitted");
            let report = &fit.report;
            println!(
                "{number}: degree {degree}, refined volume {:.5} ± {:.0e} m³ ({:+.2} %), {:.2} s, {:.5?}",
                report.volume_m3,
                report.volume_error_m3,
                100.0 * (report.volume_m3 / expected - 1.0),
                report.seconds,
                report.refinement_m3,
            );
            assert!(report.volume_m3 <= expected, "{} m³ where {expected} are possible", report.volume_m3);
            assert!(report.refinement_m3.windows(2).all(|v| v[1] < v[0]), "{:?}", report.refinement_m3);
            assert_eq!(report.refinement_end, Some(RefinementEnd::Converged));
            let again = Body::from_json(&fit.body.to_json()).expect("the stored body is proven");
            again.prove_contains(&points).expect("every point of the mesh is proven inside");
        }
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn human() {
    check(0);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn chair() {
    check(1);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn hand() {
    check(2);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn vase() {
    check(3);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn octopus() {
    check(4);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn chair_at_degree_eight() {
    let path = data("psb/101.off");
    let points = read_mesh(&path, &ReadOptions::default()).expect("the mesh is readable").mesh.points;
    let options = FitOptions { degree: 8, solver: solver_under_test(), ..FitOptions::default() };
    let fit = fit("chair", &points, &options, &mut |_| ControlFlow::Continue(())).expect("the mesh is fitted");
    println!("chair: degree 8, volume {:.4} m³, {:.1} s", fit.report.volume_m3, fit.report.seconds);
    // no independent value is known; starts near and far agree on this one
    assert!(fit.report.volume_m3 <= 1.003 * 0.8396, "{}", fit.report.volume_m3);
    assert!(fit.body.points().is_some());
}
