//! The fitted bodies that other crates' tests read are what fits make of the sample shapes.

use std::ops::ControlFlow;
use std::path::Path;
use sublevel_core::body::Body;
use sublevel_fit::{FitOptions, Solver, fit, shapes};

/// `SUBLEVEL_WRITE_BODIES=1` writes the files again.
#[test]
fn stored_bodies_are_those_of_fits() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../testkit/bodies");
    let bars = sublevel_testkit::bodies::bars();
    let shapes = [("chair", shapes::chair().vertices), ("human", shapes::human().vertices), ("bars", bars)];
    for (name, points) in shapes {
        for degree in if name == "bars" { &[4, 6][..] } else { &[2, 4, 6] } {
            // Of the solver that needs no BLAS, whose last digits are those of the machine.
            let options = FitOptions { degree: *degree, solver: Some(Solver::Structured), ..FitOptions::default() };
            // The chart knows its fitted bodies by their degree alone.
            let label = if name == "bars" { format!("F{degree}") } else { format!("F{degree} {name}") };
            let body = fit(&label, &points, &options, &mut |_| ControlFlow::Continue(())).expect("a fit").body;
            let path = folder.join(format!("{name}-d{degree}.json"));
            if std::env::var_os("SUBLEVEL_WRITE_BODIES").is_some() {
                std::fs::write(&path, body.to_json()).expect("a folder to write to");
            }
            let stored = Body::from_json(&std::fs::read_to_string(&path).expect("the file")).expect("a proven body");
            assert_eq!(stored.name(), label);
            stored.prove_contains(&points).expect("around the shape");
            let (now, then) = (body.volume().volume_m3, stored.volume().volume_m3);
            assert!((now / then - 1.0).abs() < 1e-6, "{label}: {now} m³ now, {then} m³ stored");
        }
    }
}
