//! The bodies that queries are drawn from.

use std::path::Path;
use sublevel::body::Body;
use sublevel_testkit::catalogue::soak;

/// The analytic bodies of the soak; then fitted ones, from `folder` and fitted on the spot. Half of
/// all have edges.
pub(crate) fn catalogue(folder: &Path) -> Vec<Body> {
    let mut all = soak::bodies();
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
