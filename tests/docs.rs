//! Paths and links in the documentation lead to what is there.

use std::fs;
use std::path::{Path, PathBuf};

use sublevel::service::Reason;

/// Folders that ARCHITECTURE.md names in short, and where they lie.
const SHORT: [(&str, &str); 15] = [
    ("polynomial/", "crates/core/src/polynomial/"),
    ("optimize/", "crates/core/src/optimize/"),
    ("body/", "crates/core/src/body/"),
    ("measure/", "crates/core/src/measure/"),
    ("branch_and_bound/", "crates/core/src/branch_and_bound/"),
    ("fit/", "crates/fit/src/"),
    ("robot/", "crates/robot/src/"),
    ("scene/", "crates/scene/src/"),
    ("bench/", "crates/bench/src/"),
    ("store/", "src/store/"),
    ("jobs/", "src/jobs/"),
    ("service/", "src/service/"),
    ("draw/", "src/draw/"),
    ("demo/", "src/demo/"),
    ("cli/", "src/cli/"),
];

/// Beginnings of paths from the root of the repository.
const WHOLE: [&str; 8] = ["src/", "crates/", "tests/", "proto/", "docs/", "fuzz/", "deploy/", ".ci/"];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn pages() -> Vec<PathBuf> {
    let docs = fs::read_dir(root().join("docs")).expect("the folder is readable");
    let pages = docs.map(|entry| entry.expect("an entry").path());
    let pages = pages.filter(|path| path.extension().is_some_and(|extension| extension == "md"));
    let top = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md", "fuzz/README.md"].map(|name| root().join(name));
    pages.chain(top).collect()
}

/// The parts of a text between two marks.
fn between<'a>(text: &'a str, open: &str, close: char) -> Vec<&'a str> {
    let parts = text.split(open).skip(1).filter_map(|rest| rest.split_once(close));
    parts.map(|(part, _)| part).collect()
}

#[test]
fn links_lead_somewhere() {
    let mut missing = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page is text");
        let folder = page.parent().expect("a page lies in a folder");
        for link in between(&text, "](", ')').into_iter().filter(|link| !link.contains("://") && !link.starts_with('#'))
        {
            let file = link.split('#').next().unwrap_or_default();
            if !folder.join(file).exists() {
                missing.push(format!("{}: {link}", page.display()));
            }
        }
    }
    assert!(missing.is_empty(), "\n{}", missing.join("\n"));
}

#[test]
fn paths_name_what_is_there() {
    let exists = |path: &str| root().join(path).exists();
    let mut missing = Vec::new();
    let mut found = 0;
    for name in ["docs/ARCHITECTURE.md", "CONTRIBUTING.md", "docs/server.md", "docs/numerics.md"] {
        let text = fs::read_to_string(root().join(name)).expect("a page is text");
        for (index, line) in text.lines().enumerate() {
            // Every other part of a line between backticks is code.
            for code in line.split('`').skip(1).step_by(2) {
                let is_path = code.contains('/')
                    && !code.contains([' ', '(', '<', '*', '='])
                    && (code.ends_with('/') || Path::new(code).extension().is_some());
                let short = SHORT.iter().find(|(short, _)| code.starts_with(short));
                let whole = WHOLE.iter().any(|whole| code.starts_with(whole));
                let path = match short {
                    Some((short, long)) => code.replacen(short, long, 1),
                    None => code.to_owned(),
                };
                // `mod.rs` of a folder that became a crate is its `lib.rs`.
                if is_path && (whole || short.is_some()) {
                    found += 1;
                    if !exists(&path) && !exists(&path.replace("mod.rs", "lib.rs")) {
                        missing.push(format!("{name}:{}: {code}", index + 1));
                    }
                }
            }
        }
    }
    assert!(missing.is_empty(), "\n{}", missing.join("\n"));
    assert!(found > 100, "{found} paths were looked at");
}

/// "`NAME` in `FILE`": the file names it.
#[test]
fn names_are_in_the_files_that_pages_give() {
    let (mut found, mut missing) = (0, Vec::new());
    for page in ["docs/ARCHITECTURE.md", "CONTRIBUTING.md"] {
        let text =
            fs::read_to_string(root().join(page)).expect("a page is text").replace("\n   ", " ").replace('\n', " ");
        for (before, after) in text.match_indices("` in `").map(|(at, mark)| (&text[..at], &text[at + mark.len()..])) {
            let name = before.rsplit('`').next().unwrap_or_default().rsplit("::").next().unwrap_or_default();
            let file = after.split('`').next().unwrap_or_default();
            let short = SHORT.iter().find(|(short, _)| file.starts_with(short));
            let path = root().join(short.map_or(file.to_owned(), |(short, long)| file.replacen(short, long, 1)));
            let is_name = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || c == '_');
            if is_name && path.is_file() {
                found += 1;
                let text = fs::read_to_string(&path).expect("text");
                let words = text.split(|c: char| !c.is_alphanumeric() && c != '_');
                if !words.into_iter().any(|word| word == name) {
                    missing.push(format!("{page}: {name} in {file}"));
                }
            }
        }
    }
    assert!(missing.is_empty() && found > 10, "{found} found\n{}", missing.join("\n"));
}

/// Lines of README.md, which is for first readers.
const MOST_LINES_OF_README: usize = 200;

#[test]
fn the_readme_stays_short() {
    let lines = fs::read_to_string(root().join("README.md")).expect("a page is text").lines().count();
    assert!(lines <= MOST_LINES_OF_README, "README.md has {lines} lines");
}

/// Bytes of all files in docs/, and of one picture.
const MOST: u64 = 1_500_000;
const MOST_OF_A_PICTURE: u64 = 100_000;

#[test]
fn docs_stay_small() {
    let (mut all, mut pictures, mut large) = (0, 0, Vec::new());
    for entry in fs::read_dir(root().join("docs")).expect("the folder is readable") {
        let entry = entry.expect("an entry");
        let size = entry.metadata().expect("it can be looked at").len();
        assert!(entry.path().is_file(), "a folder, which this does not look into: {}", entry.path().display());
        all += size;
        if entry.path().extension().is_some_and(|extension| extension == "svg") {
            pictures += 1;
            if size > MOST_OF_A_PICTURE {
                large.push(format!("{} has {size} bytes", entry.path().display()));
            }
        }
    }
    assert!(large.is_empty(), "\n{}", large.join("\n"));
    assert!(all <= MOST, "docs/ has {all} bytes");
    assert!(pictures > 20, "{pictures} pictures were looked at");
}

#[test]
fn docs_have_no_picture_that_no_page_shows() {
    let text: String = pages().iter().map(|page| fs::read_to_string(page).expect("a page is text")).collect();
    for entry in fs::read_dir(root().join("docs")).expect("the folder is readable") {
        let name = entry.expect("an entry").file_name().into_string().expect("a plain name");
        assert!(!name.ends_with(".svg") || text.contains(&format!("{name})")), "no page shows docs/{name}");
    }
}

#[test]
fn every_reason_of_an_error_has_a_section_and_a_link_to_it() {
    let page = fs::read_to_string(root().join("docs/errors.md")).expect("a page");
    let sections: Vec<&str> = page.lines().filter_map(|line| line.strip_prefix("## ")).collect();
    let reasons: Vec<&str> = Reason::ALL.iter().map(|reason| reason.name()).collect();
    for reason in &reasons {
        let count = sections.iter().filter(|section| *section == reason).count();
        assert_eq!(count, 1, "sections about {reason}");
        let link = format!("[`{reason}`](#{})", reason.to_lowercase());
        assert!(page.contains(&link), "the table has no {link}");
    }
    let others = sections.iter().filter(|section| !reasons.contains(section) && **section != "Without a reason");
    assert_eq!(others.collect::<Vec<_>>(), Vec::<&&str>::new(), "nobody sends these");
}

#[test]
fn every_setting_is_explained_with_its_default() {
    let page = fs::read_to_string(root().join("docs/operations.md")).expect("a page");
    let settings = sublevel::service::Config::default().to_toml();
    let mut table = String::new();
    for line in settings.lines().filter(|line| !line.is_empty()) {
        if let Some(name) = line.strip_prefix('[').and_then(|line| line.strip_suffix(']')) {
            table = format!("{name}.");
            continue;
        }
        let (key, value) = line.split_once(" = ").expect("a key and a value");
        let row = page.lines().find(|row| row.starts_with("| `") && row.contains(&format!("`{table}{key}`")));
        let row = row.unwrap_or_else(|| panic!("{table}{key} is not in the table"));
        let value = value.trim_matches('"');
        let value = value.strip_suffix(".0").unwrap_or(value);
        assert!(row.contains(value), "{table}{key}: {value} is not in {row}");
    }
}
