//! The numbers of README and docs/ are those of the committed CSV files.

use std::fs;
use std::path::{Path, PathBuf};
use sublevel_bench::numbers::{pages, written_again};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Pages whose blocks are counted, and how many each has at least.
const BLOCKS: [(&str, usize); 10] = [
    ("docs/speed.md", 9),
    ("docs/accuracy.md", 9),
    ("docs/warm.md", 3),
    ("docs/cost.md", 8),
    ("docs/detail.md", 9),
    ("docs/table1.md", 2),
    ("docs/panda.md", 6),
    ("docs/pairs.md", 7),
    ("docs/benchmarks.md", 12),
    ("README.md", 3),
];

#[test]
fn numbers_are_those_of_the_csv_files() {
    let docs = root().join("docs");
    let mut all = pages(&docs).expect("docs/ is readable");
    all.push(root().join("README.md"));
    for page in all {
        let old = fs::read_to_string(&page).expect("a page is text");
        let new = written_again(&old, &docs).unwrap_or_else(|error| panic!("{}: {error}", page.display()));
        if let Some((old, new)) = old.lines().zip(new.lines()).find(|(old, new)| old != new) {
            panic!("{}: the page has\n{old}\nwhere the CSV gives\n{new}\nrun `make docs-numbers`", page.display());
        }
        assert_eq!(old, new, "{}: run `make docs-numbers`", page.display());
    }
}

#[test]
fn tables_of_numbers_stand_in_blocks() {
    for (name, least) in BLOCKS {
        let text = fs::read_to_string(root().join(name)).expect("a page is text");
        let (mut inside, mut blocks) = (false, 0);
        for line in text.lines() {
            if line.starts_with("<!-- from ") {
                (inside, blocks) = (true, blocks + 1);
            }
            inside &= line != "<!-- end -->";
            // A time in a table is a measured one.
            let timed = [" ns", " µs", " ms"].iter().any(|unit| line.contains(unit));
            assert!(inside || !(line.starts_with('|') && timed), "{name}: by hand: {line}");
        }
        assert!(blocks >= least, "{name} has {blocks} blocks");
    }
}

/// The table of stability is compared with its CSV: cases, failures, and how far off.
#[test]
fn the_stability_table_is_that_of_its_csv() {
    let read = |name: &str| fs::read_to_string(root().join("docs").join(name)).expect("a file of docs/");
    let (report, index, csv) = (read("stability.md"), read("charts.md"), read("stability.csv"));
    let rows: Vec<Vec<&str>> = report.lines().filter(|line| line.starts_with("| ")).map(cells).collect();
    let columns = ["cold", "warm", "batch", "newton", "slsqp", "clarabel", "parry", "coal"];
    let mut compared = 0;
    for line in csv.lines().skip(1) {
        // Names contain commas.
        let (number, rest) = line.split_once(",\"").expect("a name between quotes");
        let (name, rest) = rest.split_once("\",").expect("the end of the name");
        let values: Vec<&str> = rest.split(',').collect();
        let row = rows.iter().find(|row| row.first() == Some(&number)).expect("a row of that family");
        assert_eq!(row[1], name);
        let column = columns.iter().position(|column| *column == values[0]).expect("a known method");
        let [cases, failed, worst] = [1, 2, 4].map(|k| values[k]);
        let cell = row[2 + column];
        if failed == "0" {
            assert_eq!(cell, format!("pass ({cases})"), "{name}, {}", values[0]);
        } else {
            assert!(cell.starts_with(&format!("**{failed} of {cases}**")), "{name}, {}: {cell}", values[0]);
            let worst = worst.parse().map_or(String::new(), |worst: f64| format!("off by up to {worst:.0e}"));
            assert!(cell.contains(&worst), "{name}, {}: {cell} where the CSV has {worst}", values[0]);
        }
        compared += 1;
    }
    assert!(compared > 100, "{compared} cells were compared");
    for line in report.lines().filter(|line| line.starts_with("| ")) {
        assert!(index.contains(line), "charts.md lacks {line}");
    }
}

fn cells(line: &str) -> Vec<&str> {
    line.trim_matches('|').split('|').map(str::trim).collect()
}
