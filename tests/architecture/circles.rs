//! No two files import each other, directly or through others, so that a file can be understood
//! from the files that it imports.
//!
//! The sources are read as text. A path counts for the file that defines what it names: re-exports
//! (`pub use`) are followed. A module that declares its children does not import them by that.

use crate::source::{identifier, is_test_file, rust_files, without_comments_and_literals, without_tests};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Sources of each crate.
const CRATES: [&str; 7] = [
    "crates/core/src",
    "crates/fit/src",
    "crates/robot/src",
    "crates/scene/src",
    "crates/bench/src",
    "crates/testkit/src",
    "src",
];

#[test]
fn no_files_import_each_other() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let found: Vec<String> = CRATES
        .iter()
        .flat_map(|folder| {
            let source = root.join(folder);
            let files = rust_files(&source).into_iter().filter_map(|file| {
                let inside = file.strip_prefix(&source).expect("the walk starts there").to_owned();
                let text = fs::read_to_string(&file).expect("a source file is readable");
                (!is_test_file(&inside)).then(|| (inside.to_string_lossy().into_owned(), text))
            });
            let circles = Sources::new(files).circles();
            circles.into_iter().map(move |circle| format!("{folder}: {circle}"))
        })
        .collect();
    assert!(found.is_empty(), "files that import each other:\n{}", found.join("\n"));
}

#[test]
fn circles_are_found() {
    let circles = |files: &[(&str, &str)]| {
        let files = files.iter().map(|(name, text)| ((*name).to_owned(), (*text).to_owned()));
        Sources::new(files).circles().len()
    };
    let direct = [("lib.rs", "mod a; mod b;"), ("a.rs", "use crate::b::B;"), ("b.rs", "use super::a::A;")];
    assert_eq!(circles(&direct), 1);
    let over_a_re_export = [
        ("lib.rs", "mod a; mod b;"),
        ("a/mod.rs", "mod one; pub use one::One;"),
        ("a/one.rs", "use crate::b::B;"),
        ("b.rs", "use crate::{a::{One}, c};"),
    ];
    assert_eq!(circles(&over_a_re_export), 1);
    let over_a_module = [
        ("lib.rs", "mod a; mod b;"),
        ("a/mod.rs", "mod one; pub use one::first;"),
        ("a/one.rs", "fn first() { crate::b::f() }"),
        ("b.rs", "use crate::a; fn f() { a::first() }"),
    ];
    assert_eq!(circles(&over_a_module), 1);
    let with_the_parent = [("lib.rs", "mod a; use a::A; pub const X: u8 = 1;"), ("a.rs", "use super::X;")];
    assert_eq!(circles(&with_the_parent), 1);
    let of_three = [
        ("lib.rs", "mod a; mod b; mod c;"),
        ("a.rs", "use crate::b::B;"),
        ("b.rs", "use crate::c::{C, D as E};"),
        ("c.rs", "fn f(_: crate::a::A) {}"),
    ];
    assert_eq!(circles(&of_three), 1);
}

#[test]
fn what_is_no_circle_passes() {
    let files = [
        ("lib.rs", "mod a; mod b; pub use a::A;"),
        ("a/mod.rs", "mod one; mod two; pub use one::One; fn f() { one::g() }"),
        ("a/one.rs", "use super::two::Two; use std::fs;"),
        ("a/two.rs", "use crate::b; fn f() { b::b() }\n#[cfg(test)] mod tests { use super::super::A; }"),
        ("b.rs", "// use crate::a::One;\nconst TEXT: &str = \"crate::a::One\";"),
    ];
    let files = files.into_iter().map(|(name, text)| (name.to_owned(), text.to_owned()));
    assert_eq!(Sources::new(files).circles(), Vec::<String>::new());
}

/// The path of a module from the root of its crate.
type Module = Vec<String>;

/// One path that a file names.
struct Named {
    segments: Vec<String>,
    /// What a `use` calls it; empty for paths inside code.
    alias: String,
    /// Whether others may name it here.
    is_public: bool,
}

/// The files of a crate by the modules they define.
struct Sources {
    files: BTreeMap<Module, (String, Vec<Named>, String)>,
}

impl Sources {
    /// From pairs of a path inside the sources and the text.
    fn new(files: impl IntoIterator<Item = (String, String)>) -> Self {
        let parsed = files.into_iter().map(|(name, text)| {
            let code = without_tests(&without_comments_and_literals(&text));
            let (uses, rest) = uses_of(&code);
            (module_of(&name), (name, uses, rest))
        });
        Self { files: parsed.collect() }
    }

    /// For each group of files that import each other, its imports.
    fn circles(&self) -> Vec<String> {
        let edges: BTreeMap<&Module, BTreeMap<Module, String>> =
            self.files.keys().map(|module| (module, self.imports_of(module))).collect();
        let reaches = |from: &Module| {
            let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
            while let Some(module) = open.pop() {
                for next in edges.get(&module).into_iter().flat_map(BTreeMap::keys) {
                    if seen.insert(next.clone()) {
                        open.push(next.clone());
                    }
                }
            }
            seen
        };
        let reached: BTreeMap<&Module, BTreeSet<Module>> =
            edges.keys().map(|module| (*module, reaches(module))).collect();
        let mut circles = BTreeSet::new();
        for (module, below) in &reached {
            let both = |other: &&Module| below.contains(*other) && reached[*other].contains(*module);
            let members: BTreeSet<&Module> = edges.keys().copied().filter(both).chain([*module]).collect();
            if members.len() > 1 {
                let within = members.iter().flat_map(|from| {
                    let to = edges[*from].iter().filter(|(to, _)| members.contains(to));
                    to.map(|(to, what)| format!("{} takes {what} from {}", self.files[*from].0, self.files[to].0))
                });
                circles.insert(within.collect::<Vec<_>>().join("; "));
            }
        }
        circles.into_iter().collect()
    }

    /// The other files that a file takes something from, and what for example.
    fn imports_of(&self, module: &Module) -> BTreeMap<Module, String> {
        let (_, uses, code) = &self.files[module];
        let mut modules: BTreeMap<String, Module> = BTreeMap::new();
        let mut found = BTreeMap::new();
        let mut add = |target: Option<(Module, String)>| {
            if let Some((target, item)) = target.filter(|(target, _)| target != module) {
                found.entry(target).or_insert(item);
            }
        };
        for named in uses {
            match self.resolve(module, &named.segments) {
                // A module alone: what is taken of it shows where it is named.
                Some((target, item)) if item.is_empty() => {
                    modules.insert(named.alias.clone(), target);
                }
                target => add(target),
            }
        }
        for path in paths_in(code) {
            let known = modules.get(&path[0]).filter(|_| path.len() > 1);
            let target = match known {
                Some(start) => self.resolve_below(start.clone(), &path[1..]),
                None => self.resolve(module, &path),
            };
            add(target.filter(|(_, item)| !item.is_empty()));
        }
        found
    }

    /// The file that defines what a path names inside a module, and the name; of a module itself no
    /// name. None outside the crate.
    fn resolve(&self, from: &Module, path: &[String]) -> Option<(Module, String)> {
        let mut start = from.clone();
        let mut rest = path;
        match rest.first()?.as_str() {
            "crate" => {
                start.clear();
                rest = &rest[1..];
            }
            "self" => rest = &rest[1..],
            "super" => {
                while rest.first().is_some_and(|segment| segment == "super") {
                    start.pop()?;
                    rest = &rest[1..];
                }
            }
            first => {
                start.push(first.to_owned());
                if !self.files.contains_key(&start) {
                    return None;
                }
                rest = &rest[1..];
            }
        }
        self.resolve_below(start, rest)
    }

    fn resolve_below(&self, mut module: Module, mut rest: &[String]) -> Option<(Module, String)> {
        while let Some(segment) = rest.first() {
            module.push(segment.clone());
            if !self.files.contains_key(&module) {
                module.pop();
                break;
            }
            rest = &rest[1..];
        }
        let (_, uses, _) = self.files.get(&module)?;
        let Some(item) = rest.first() else { return Some((module, String::new())) };
        let re_export = uses.iter().find(|named| named.is_public && named.alias == *item);
        match re_export {
            Some(named) => {
                let path: Vec<String> = named.segments.iter().chain(&rest[1..]).cloned().collect();
                self.resolve(&module, &path)
            }
            None => Some((module, item.clone())),
        }
    }
}

/// `measure/mod.rs` and `measure.rs` both define `measure`; `lib.rs` and `main.rs` the root.
fn module_of(file: &str) -> Module {
    let path = file.trim_end_matches(".rs");
    let mut module: Module = path.split('/').map(str::to_owned).collect();
    if ["mod", "lib"].contains(&module[module.len() - 1].as_str()) {
        module.pop();
    }
    module
}

/// The paths of all `use` items, and the code without these.
fn uses_of(code: &str) -> (Vec<Named>, String) {
    let (mut uses, mut kept, mut rest) = (Vec::new(), String::new(), code);
    while let Some(at) = rest.find("use ") {
        let begins = rest[..at].ends_with(|c: char| c.is_whitespace() || c == ';' || c == '}') || at == 0;
        let end = rest[at..].find(';').map_or(rest.len(), |length| at + length + 1);
        if !begins {
            kept.push_str(&rest[..at + 4]);
            rest = &rest[at + 4..];
            continue;
        }
        let before = rest[..at].trim_end();
        let is_public = before.ends_with("pub") || before.ends_with(')');
        expand(rest[at + 4..end].trim_end_matches(';').trim(), &[], is_public, &mut uses);
        kept.push_str(&rest[..at]);
        rest = &rest[end..];
    }
    (uses, kept + rest)
}

/// The paths of one `use` tree.
fn expand(tree: &str, before: &[String], is_public: bool, uses: &mut Vec<Named>) {
    let tree = tree.trim();
    let mut segments = before.to_vec();
    if let Some((path, group)) = tree.split_once('{') {
        segments.extend(path.split("::").map(str::trim).filter(|segment| !segment.is_empty()).map(str::to_owned));
        let group = group.strip_suffix('}').unwrap_or(group);
        let (mut depth, mut start) = (0, 0);
        for (at, c) in group.char_indices().chain([(group.len(), ',')]) {
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => {
                    if !group[start..at].trim().is_empty() {
                        expand(&group[start..at], &segments, is_public, uses);
                    }
                    start = at + 1;
                }
                _ => {}
            }
        }
        return;
    }
    let (path, alias) = tree.split_once(" as ").map_or((tree, None), |(path, alias)| (path, Some(alias.trim())));
    segments.extend(path.split("::").map(str::trim).filter(|segment| !segment.is_empty()).map(str::to_owned));
    if segments.len() > 1 && segments.last().is_some_and(|last| last == "self" || last == "*") {
        segments.pop();
    }
    let alias = alias.map_or_else(|| segments.last().cloned().unwrap_or_default(), str::to_owned);
    uses.push(Named { segments, alias, is_public });
}

/// All paths of two or more segments in code.
fn paths_in(code: &str) -> Vec<Vec<String>> {
    let mut paths = Vec::new();
    let mut rest = code;
    while let Some(at) = rest.find(|c: char| c.is_alphabetic() || c == '_') {
        rest = &rest[at..];
        let mut path = Vec::new();
        loop {
            let segment = identifier(rest);
            rest = &rest[segment.len()..];
            path.push(segment);
            match rest.strip_prefix("::") {
                Some(next) if next.starts_with(|c: char| c.is_alphabetic() || c == '_') => rest = next,
                _ => break,
            }
        }
        if path.len() > 1 {
            paths.push(path);
        }
        // Digits and the like that no identifier begins with.
        rest = rest.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_');
    }
    paths
}
