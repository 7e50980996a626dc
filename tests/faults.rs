//! Files as other programs write them, and damaged ones: read as they are meant, or refused with
//! the place, the reason and the remedy. The values are those of the data's own description,
//! computed independently.

#![cfg(feature = "fit")]

use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::{Command, Output};
use sublevel::fit::{Fit, FitOptions, ReadOptions, Reading, fit, fit_parts, read_mesh};

/// Volume of the smallest ellipsoid around the nine corners of the house, m³.
const HOUSE_M3: f64 = 16.755161;

fn fault(name: &str) -> PathBuf {
    sublevel_testkit::data("faults").join(name)
}

fn reading(name: &str) -> Reading {
    read_mesh(&fault(name), &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn points(name: &str) -> Vec<Vector3<f64>> {
    reading(name).mesh.points
}

fn ellipsoid(points: &[Vector3<f64>]) -> Fit {
    let options = FitOptions { degree: 2, ..FitOptions::default() };
    fit("it", points, &options, &mut |_| ControlFlow::Continue(())).expect("a fit")
}

fn is_the_house(name: &str, points: &[Vector3<f64>]) {
    let volume = ellipsoid(points).report.volume_m3;
    assert_eq!(points.len(), 9, "{name}");
    assert!((volume - HOUSE_M3).abs() < 2e-5 * HOUSE_M3, "{name}: {volume} m³");
}

fn sublevel(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sublevel")).args(args).output().expect("the program runs")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn all_solids_of_a_text_stl_count() {
    let [stl, off] = ["two-solids.stl", "two-solids.off"].map(points);
    assert_eq!((stl.len(), off.len()), (17, 17));
    for body in [ellipsoid(&stl).body, ellipsoid(&off).body] {
        body.prove_contains(&stl).expect("all of the STL");
        body.prove_contains(&off).expect("all of the OFF");
    }
    let [stl, off] = ["two-solids.stl", "two-solids.off"].map(|name| reading(name).mesh.triangles.len());
    assert_eq!(stl, off);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn text_stl_keeps_coordinates_of_a_whole_country() {
    let [stl, off] = ["large-coordinates.stl", "large-coordinates.off"].map(points);
    let sorted = |mut points: Vec<Vector3<f64>>| {
        points.sort_by(|a, b| a.as_slice().partial_cmp(b.as_slice()).expect("finite"));
        points
    };
    ellipsoid(&stl).body.prove_contains(&off).expect("all corners, to the last digit");
    assert_eq!(sorted(stl), sorted(off));
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn dialects_are_the_house() {
    for name in ["capitals.stl", "blank-before-solid.stl", "nan-normals.stl", "continued-lines.obj"] {
        is_the_house(name, &points(name));
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn decimal_commas_and_pointers_are_refused() {
    for (name, parts) in [
        ("decimal-comma.xyz", ["line 1", "write decimal points in place of decimal commas"]),
        ("lfs-pointer.stl", ["Git LFS pointer", "git lfs pull"]),
    ] {
        let path = fault(name);
        let error = read_mesh(&path, &ReadOptions::default()).expect_err("it is no mesh").to_string();
        assert!(error.contains(name) && parts.iter().all(|part| error.contains(part)), "{error}");
        let output = sublevel(&["fit", path.to_str().unwrap(), "--out", std::env::temp_dir().to_str().unwrap()]);
        let said = stderr(&output);
        assert!(!output.status.success() && said.lines().count() == 1 && said.contains(parts[0]), "{said}");
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn concave_faces_fill_their_outline_and_no_more() {
    for name in ["concave-faces.obj", "concave-faces-triangles.obj"] {
        let mesh = reading(name).mesh;
        // The volume within a closed mesh.
        let volume: f64 = mesh
            .triangles
            .iter()
            .map(|t| t.map(|corner| mesh.points[corner]))
            .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
            .sum();
        assert!((volume.abs() - 5.0).abs() < 1e-12, "{name}: {volume} m³");
        let options = FitOptions { degree: 2, ..FitOptions::default() };
        let fit = fit_parts("l", &mesh, 2, &options, &mut |_| ControlFlow::Continue(())).expect("two parts");
        let hulls: f64 =
            fit.compound.parts().iter().map(|part| part.provenance().expect("fits have one").hull_volume_m3).sum();
        assert!(fit.compound.parts().len() == 2 && hulls <= 5.011, "{name}: {hulls} m³");
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn a_stray_vertex_is_reported_with_its_cost() {
    let path = fault("stray-vertex.obj");
    let folder = tempfile::tempdir().expect("a folder");
    let (path, out) = (path.to_str().unwrap(), folder.path().to_str().unwrap());
    let fit = ["fit", path, "--out", out, "--degree", "2", "--json"];
    let output = sublevel(&fit);
    let said = stderr(&output);
    assert!(output.status.success(), "{said}");
    assert!(
        said.starts_with("note: ") && said.contains("1 of 10 vertices") && said.contains("--drop-unused"),
        "{said}"
    );
    let row = |output: &Output| -> serde_json::Value {
        let rows: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
        rows[0].clone()
    };
    let with = row(&output);
    assert!((with["volume_m3"].as_f64().unwrap() / 1224.0 - 1.0).abs() < 2e-3, "{with}");
    assert!(with["unused_vertices"] == 1 && with["unused_dropped"] == false, "{with}");
    assert!((with["hull_without_unused_m3"].as_f64().unwrap() - 7.0).abs() < 1e-9, "{with}");

    let output = sublevel(&[&fit[..], &["--drop-unused"]].concat());
    let without = row(&output);
    assert!((without["volume_m3"].as_f64().unwrap() / HOUSE_M3 - 1.0).abs() < 2e-5, "{without}");
    assert!(without["unused_dropped"] == true && without["points"] == 9, "{without}");
    let body = without["body"].as_str().unwrap();
    let verified = sublevel(&["verify", body, "--points", path, "--drop-unused"]);
    assert!(verified.status.success(), "{}", stderr(&verified));
    assert!(!sublevel(&["verify", body, "--points", path]).status.success(), "the stray vertex is outside");

    let output = sublevel(&[&fit[..], &["--parts", "2"]].concat());
    assert_eq!(row(&output)["points"], 9, "a compound counts the vertices that its triangles use");
}
