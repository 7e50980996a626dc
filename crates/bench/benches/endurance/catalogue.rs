//! The bodies that queries are drawn from.

use std::path::Path;
use sublevel::body::Body;
use sublevel_testkit::bodies::{b, c, cut, cylinder, e, p, q};

/// Half-extents of bodies with edges, metres.
const HALVES: [[f64; 3]; 12] = [
    [0.6, 0.9, 0.3],
    [1.0, 1.0, 1e-3],
    [0.02, 0.03, 0.01],
    [1.0, 1.0, 1.0],
    [5.0, 4.0, 0.05],
    [0.01, 0.01, 2.0],
    [8.0, 6.0, 7.0],
    [0.3, 0.02, 0.4],
    [2.0, 0.5, 0.5],
    [0.05, 0.04, 0.06],
    [0.2, 0.2, 2.0],
    [1.5, 1.0, 0.7],
];

/// Analytic bodies of every kind, sizes 1e-2 to 10, thin and round; then fitted ones, from `folder`
/// and fitted on the spot. Half of all have edges: boxes, cylinders, and bodies that slabs cut.
pub(crate) fn catalogue(folder: &Path) -> Vec<Body> {
    let mut all = vec![
        e(1.0, 1.0, 1.0),
        e(1.0, 0.7, 0.4),
        e(0.01, 0.01, 1.0),
        e(1.0, 1.0, 0.01),
        e(0.03, 0.02, 0.025),
        e(10.0, 6.0, 8.0),
    ];
    for [x, y, z] in HALVES {
        all.extend([b(x, y, z), cylinder(x, z), cut(x, y, z)]);
    }
    for degree in [4, 6, 8] {
        all.extend([q(degree, 0.8, 0.5, 1.1), q(degree, 0.05, 0.05, 1.0), q(degree, 1.0, 1.0, 0.02)]);
        all.extend([c(degree, 0.5, 1.0), c(degree, 1.0, 0.05), p(degree, 0.7), p(degree, 0.02), p(degree, 5.0)]);
    }
    fit_missing(folder);
    all.extend(read(folder));
    all
}

/// All body files of a folder, in the order of their names.
pub(crate) fn read(folder: &Path) -> Vec<Body> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("a folder entry is readable").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "json"));
    paths.sort();
    let body = |path: &std::path::PathBuf| {
        let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Body::from_json(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    paths.iter().map(body).collect()
}

/// Fits a chair and a human at degrees 2 to 8, unless the folder has them from an earlier run.
fn fit_missing(folder: &Path) {
    use std::ops::ControlFlow;
    use sublevel::fit::shapes;
    use sublevel::fit::{FitOptions, fit};
    std::fs::create_dir_all(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    for (name, shape) in [("chair", shapes::chair()), ("human", shapes::human())] {
        for degree in [2, 4, 6, 8] {
            let path = folder.join(format!("{name}-d{degree}.json"));
            if path.exists() {
                continue;
            }
            eprintln!("fitting {name} at degree {degree}");
            let options = FitOptions { degree, ..FitOptions::default() };
            let name = format!("F{degree} {name}");
            let fitted = fit(&name, &shape.vertices, &options, &mut |_| ControlFlow::Continue(()));
            let body = fitted.unwrap_or_else(|error| panic!("{name}: {error}")).body;
            crate::state::write(&path, &body.to_json());
        }
    }
}
