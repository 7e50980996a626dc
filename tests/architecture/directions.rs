//! Keeps the layers of the code apart: which may import which, and which words belong to one layer
//! only.
//!
//! Cargo keeps the directions between crates; this test keeps those between the folders of
//! `sublevel-core` and of `sublevel`. The sources are read as text, with comments, literals and
//! test modules blanked out, and every path that starts at `crate::` or at one of the crates (or
//! climbs out of a layer with `super::`) is compared with the table of allowed directions.

use crate::source::{identifier, is_test_file, rust_files, without_comments_and_literals, without_tests};
use std::fs;
use std::path::Path;

/// For each layer (a folder or file of `crates/core/src` or `src`, or a crate), the layers it may
/// import.
const DIRECTIONS: &[(&str, &[&str])] = &[
    ("polynomial", &[]),
    ("optimize", &[]),
    ("body", &["polynomial", "optimize"]),
    ("measure", &["body", "polynomial", "optimize"]),
    ("branch_and_bound", &["measure", "body", "polynomial"]),
    // Of measure, the pose.
    ("fit", &["branch_and_bound", "measure", "body", "polynomial", "optimize"]),
    ("robot", &["measure", "body"]),
    ("scene", &["robot", "branch_and_bound", "measure", "body"]),
    // Of measure, the pose.
    ("store", &["body", "scene", "robot", "measure"]),
    ("jobs", &["fit", "store", "scene", "robot", "body"]),
    // Of polynomial, the instruction set.
    ("service", &["jobs", "store", "scene", "robot", "measure", "body", "polynomial"]),
    // Of service, the messages.
    ("client", &["service", "jobs", "store", "scene", "robot", "measure", "body"]),
    ("load", &["client", "draw", "scene", "measure", "body"]),
    ("draw", &["body", "optimize"]),
    ("demo", ANY),
    ("cli", ANY),
];

const ANY: &[&str] = &[
    "polynomial",
    "optimize",
    "body",
    "measure",
    "branch_and_bound",
    "fit",
    "robot",
    "scene",
    "store",
    "jobs",
    "service",
    "client",
    "load",
    "draw",
    "demo",
];

/// Where the layers lie: folders whose entries are layers, and crates that are one.
const SOURCES: [(&str, Option<&str>); 5] = [
    ("crates/core/src", None),
    ("crates/fit/src", Some("fit")),
    ("crates/robot/src", Some("robot")),
    ("crates/scene/src", Some("scene")),
    ("src", None),
];

/// Words that one layer (or a few) may name, and no other: wire formats, bytes on disk.
const PRIVATE_WORDS: &[(&str, &[&str])] = &[
    ("prost", &["service", "client", "load"]),
    ("tonic", &["service", "client", "load"]),
    ("tonic_prost", &["service"]),
    ("tonic_health", &["service", "client"]),
    ("tonic_reflection", &["service"]),
    ("tonic_types", &["service", "client"]),
    ("redb", &["store"]),
    ("clarabel", &["fit"]),
    ("plotters", &["draw"]),
];

/// Words that a layer may not name: `measure` knows neither clock nor allocator nor threads.
const FORBIDDEN_WORDS: &[(&str, &[&str])] = &[(
    "measure",
    &[
        "Instant",
        "SystemTime",
        "thread",
        "Vec",
        "vec",
        "Box",
        "Rc",
        "Arc",
        "String",
        "format",
        "collect",
        "to_vec",
        "DMatrix",
        "DVector",
    ],
)];

#[test]
fn every_layer_keeps_to_its_directions() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut violations = Vec::new();
    for (folder, name) in SOURCES {
        let source = root.join(folder);
        for file in rust_files(&source) {
            let inside = file.strip_prefix(&source).expect("the walk starts there");
            let layer = name.map_or_else(|| layer_of(inside), str::to_owned);
            if ["lib", "main"].contains(&layer.as_str()) || is_test_file(inside) {
                continue;
            }
            let text = fs::read_to_string(&file).expect("a source file is readable");
            let found = check(&layer, &text, &siblings_of(&file));
            violations.extend(found.into_iter().map(|what| format!("{folder}/{}: {what}", inside.display())));
        }
    }
    assert!(violations.is_empty(), "\n{}", violations.join("\n"));
}

#[test]
fn a_violation_is_found() {
    let found = |layer: &str, text: &str| !check(layer, text, &[]).is_empty();
    assert!(found("polynomial", "use crate::body::Body;"));
    assert!(found("body", "fn f() { crate::measure::distance() }"));
    assert!(found("measure", "use crate::{body::Body, optimize::{self, Options}}; use sublevel_fit::fit;"));
    assert!(found("store", "use super::service::wire;"));
    assert!(found("fit", "use sublevel::service::Server;"));
    assert!(found("fit", "use sublevel_scene::Scene;"));
    assert!(found("scene", "use sublevel_core::{body::Body, polynomial::Jet};"));
    assert!(found("scene", "fn f(status: tonic::Status) {}"));
    assert!(found("service", "let table = redb::Database::open(path);"));
    assert!(found("measure", "let list: Vec<f64> = Vec::new();"));
    assert!(found("measure", "let start = std::time::Instant::now();"));
    assert!(found("measure", "use std::{thread, f64};"));
    assert!(found("newcomer", "fn f() {}"), "a layer that the table does not know is a violation");
}

#[test]
fn what_is_allowed_passes() {
    let clean = |layer: &str, text: &str| assert_eq!(check(layer, text, &[]), Vec::<String>::new());
    clean("measure", "use crate::{body::{Body, Ball}, polynomial::Jet, measure::Pose};");
    clean("measure", "// Vec and String in a comment\n/* crate::fit */ const NAME: &str = \"Vec crate::fit\";");
    clean("measure", "#[cfg(test)]\nmod tests { use crate::fit::fit; fn f() { vec![1]; } }");
    clean("measure", "fn f<'a>(quote: char) -> bool { quote == '\"' || quote == '\\'' }");
    clean("fit", "use sublevel_core::{body::Body, polynomial::Jet}; use crate::hull;");
    clean("service", "use tonic::Status; use crate::store::Catalogue;");
    // A file of the same layer may bear the name of another layer.
    assert!(check("service", "use super::store::table;", &["store".into()]).is_empty());
}

/// Everything wrong with one file of a layer; `siblings` are the modules that lie beside it in the
/// same layer.
fn check(layer: &str, text: &str, siblings: &[String]) -> Vec<String> {
    let code = without_tests(&without_comments_and_literals(text));
    let Some((_, allowed)) = DIRECTIONS.iter().find(|(name, _)| *name == layer) else {
        return vec![format!("layer {layer} has no row in the table of directions")];
    };
    let is_layer = |name: &str| DIRECTIONS.iter().any(|(layer, _)| *layer == name);
    let words: Vec<&str> = code.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
    let mut imports: Vec<String> =
        ["crate::", "sublevel::", "sublevel_core::"].iter().flat_map(|prefix| names_after(&code, prefix)).collect();
    let crates = [("sublevel_fit", "fit"), ("sublevel_robot", "robot"), ("sublevel_scene", "scene")];
    imports.extend(crates.iter().filter(|(word, _)| words.contains(word)).map(|(_, layer)| (*layer).to_owned()));
    let mut violations = Vec::new();
    for name in imports {
        if is_layer(&name) && name != layer && !allowed.contains(&name.as_str()) {
            violations.push(format!("{layer} may not import {name}"));
        }
    }
    for name in names_after(&code, "super::") {
        if is_layer(&name) && name != layer && !siblings.contains(&name) {
            violations.push(format!("{layer} reaches {name} through super; write crate::{name}"));
        }
    }
    for (word, layers) in PRIVATE_WORDS {
        if words.contains(word) && !layers.contains(&layer) {
            violations.push(format!("only {} may name {word}", layers.join(", ")));
        }
    }
    for (_, forbidden) in FORBIDDEN_WORDS.iter().filter(|(name, _)| *name == layer) {
        let named = forbidden.iter().filter(|word| words.contains(word));
        violations.extend(named.map(|word| format!("{layer} may not name {word}")));
    }
    violations
}

/// First path segments after each `prefix`, those of a braced group one by one.
pub(crate) fn names_after(code: &str, prefix: &str) -> Vec<String> {
    let mut names = Vec::new();
    for (at, _) in code.match_indices(prefix) {
        if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_') {
            continue;
        }
        let rest = code[at + prefix.len()..].trim_start();
        let Some(group) = rest.strip_prefix('{') else {
            names.push(identifier(rest));
            continue;
        };
        let mut depth = 0;
        let mut at_start = true;
        for (offset, c) in group.char_indices() {
            match c {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                ',' if depth == 0 => at_start = true,
                c if at_start && !c.is_whitespace() => {
                    names.push(identifier(&group[offset..]));
                    at_start = false;
                }
                _ => {}
            }
        }
    }
    names
}

/// `measure/pose.rs` and `measure.rs` both belong to `measure`.
fn layer_of(inside: &Path) -> String {
    let first = inside.iter().next().expect("the path of a file is not empty");
    Path::new(first).file_stem().expect("a file has a name").to_string_lossy().into_owned()
}

/// Modules beside a file in the same layer; none for its own `mod.rs`, whose `super` is the crate.
fn siblings_of(file: &Path) -> Vec<String> {
    let is_root = file.file_name().is_some_and(|name| name == "mod.rs");
    let folder = file.parent().expect("a file lies in a folder");
    if is_root || folder.ends_with("src") {
        return Vec::new();
    }
    let entries = fs::read_dir(folder).expect("a source folder is readable");
    let stems = entries.filter_map(|entry| Some(entry.ok()?.path().file_stem()?.to_string_lossy().into_owned()));
    stems.collect()
}
