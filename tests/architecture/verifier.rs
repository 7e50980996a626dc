//! What checks certificates of motions searches for nothing and solves nothing: a certificate is
//! worth as much as the little code that checks it.
//!
//! The files are those that `verify.rs` takes something from, directly or through others, and what
//! makes the problem of a claim again.

use crate::directions::names_after;
use crate::source::{rust_files, without_comments_and_literals, without_tests};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Where they lie.
const FOLDER: &str = "crates/robot/src/motion";

/// What is known of bodies and poses, of `sublevel_core::measure`: no functions.
const DATA: [&str; 4] = ["Capsule", "HalfSpace", "Motion", "Pose"];

/// What searches and solves, wherever it comes from.
const SOLVERS: [&str; 23] = [
    "solve",
    "prove",
    "derive_pairs",
    "distance",
    "signed_distance",
    "distance_of_capsules",
    "distance_to_capsule",
    "distance_to_half_space",
    "distance_to_point",
    "distance_batch",
    "nearer_than",
    "within_margin",
    "overlap",
    "overlap_with_capsule",
    "penetration",
    "growth_distance",
    "level_distance",
    "time_of_impact",
    "cast_ray",
    "cast_ball",
    "ActiveConstraints",
    "Options",
    "WarmStart",
];

#[test]
fn certificates_are_checked_without_a_solver() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(FOLDER);
    let files = rust_files(&folder).into_iter().map(|file| {
        let name = file.file_stem().expect("a file has a name").to_string_lossy().into_owned();
        (name, fs::read_to_string(file).expect("a source file is readable"))
    });
    let files: BTreeMap<String, String> = files.collect();
    let verifier = reached(&["verify", "claim_of_problem"], &files);
    // The walk has found the files that the proof is made of.
    for name in [
        "bound",
        "certificate",
        "claim",
        "claim_of_problem",
        "interval",
        "path",
        "placing",
        "planes",
        "screw",
        "verify",
    ] {
        assert!(verifier.contains(name), "{name} is no longer a part of what checks certificates: {verifier:?}");
    }
    let found: Vec<String> = verifier
        .iter()
        .flat_map(|name| check(&files[name]).into_iter().map(move |what| format!("{FOLDER}/{name}.rs: {what}")))
        .collect();
    assert!(found.is_empty(), "\n{}", found.join("\n"));
    // What solves is found to do so.
    assert!(!verifier.contains("solve") && !verifier.contains("prove"), "{verifier:?}");
    assert!(["solve", "prove", "derive"].iter().all(|name| !check(&files[*name]).is_empty()));
}

#[test]
fn what_solves_is_found() {
    let found = |text: &str| !check(text).is_empty();
    assert!(found("use sublevel_core::measure::{Pose, signed_distance};"));
    assert!(found("use sublevel_core::measure::WarmStart;"));
    assert!(found("use sublevel_core::measure;"), "a whole module may be anything");
    assert!(found("use sublevel_core::measure::*;"));
    assert!(found("use sublevel_core::optimize::newton;"));
    assert!(found("fn f() { sublevel_core::measure::overlap(a, b) }"));
    assert!(found("use super::solve::Solved;"));
    assert!(found("use super::*;"));
    assert!(found("use crate::motion::prove;"));
    assert!(found("fn f(problem: &MotionProblem) { problem.prove(path, options, workspace) }"));
    let clean = |text: &str| assert_eq!(check(text), Vec::<String>::new());
    clean("use sublevel_core::measure::{Capsule, Pose}; use super::planes::{Height, gap}; use crate::kinematics::K;");
    clean("/// The signed distance; see solve().\nfn f() { g(\"prove\") }");
    clean("fn f() {}\n#[cfg(test)]\nmod tests { use super::*; use sublevel_core::measure::distance; }");
    let files = [("verify", "use super::a::A;"), ("a", "use super::{b, c::C};"), ("b", ""), ("c", ""), ("d", "")];
    let files = files.into_iter().map(|(name, text)| (name.to_owned(), text.to_owned())).collect();
    assert_eq!(reached(&["verify"], &files).iter().map(String::as_str).collect::<Vec<_>>(), ["a", "b", "c", "verify"]);
}

fn code(text: &str) -> String {
    without_tests(&without_comments_and_literals(text))
}

/// The files that some take something from, these included.
fn reached(first: &[&str], files: &BTreeMap<String, String>) -> BTreeSet<String> {
    let (mut seen, mut open) = (BTreeSet::new(), first.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
    while let Some(name) = open.pop() {
        let Some(text) = files.get(&name) else { continue };
        if seen.insert(name) {
            open.extend(names_after(&code(text), "super::"));
        }
    }
    seen
}

/// Everything in a file that searches, solves, or may do so.
fn check(text: &str) -> Vec<String> {
    let code = code(text);
    let mut violations = Vec::new();
    let mut only = |prefix: &str, allowed: &[&str]| {
        let others = names_after(&code, prefix).into_iter().filter(|name| !allowed.contains(&name.as_str()));
        violations.extend(others.map(|name| format!("{prefix}{name}")));
    };
    only("sublevel_core::measure::", &DATA);
    only("sublevel_core::", &["body", "measure"]);
    // Text of errors is no part of a proof.
    only("crate::", &["counted", "description", "kinematics"]);
    if names_after(&code, "super::").iter().any(|name| ["", "solve", "prove", "derive"].contains(&name.as_str())) {
        violations.push("takes something from what solves, or from anywhere".to_owned());
    }
    // The module under another name, or all of it.
    let whole = ["sublevel_core::measure;", "sublevel_core::measure as", "sublevel_core::{"];
    violations.extend(whole.iter().filter(|whole| code.contains(**whole)).map(|whole| (*whole).to_owned()));
    let words: BTreeSet<&str> = code.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
    violations.extend(SOLVERS.iter().filter(|word| words.contains(**word)).map(|word| format!("names {word}")));
    violations
}
