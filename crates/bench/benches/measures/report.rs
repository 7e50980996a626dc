//! Tables: times, ratios to coal, targets and whether they are met.

use crate::machine::Machine;
use crate::motion::{Character, Kind};
use crate::rows::{COAL_COLD, COAL_WARM, DEGREE, Scene};
use crate::sweep::{Row, Target};
use serde::Serialize;
use std::fmt::Write;
use sublevel_bench::comparison::Coal;

/// All results of a run.
#[derive(Serialize)]
pub(crate) struct Report {
    machine: Machine,
    pub(crate) tables: Vec<Table>,
}

/// One pair on one kind of motion.
#[derive(Serialize)]
pub(crate) struct Table {
    pub(crate) pair: String,
    kind: Kind,
    hull_vertices: [usize; 2],
    poses: usize,
    /// Of the bodies of degree 6.
    motion: Character,
    rows: Vec<Line>,
}

/// One row.
#[derive(Serialize)]
struct Line {
    label: String,
    nanoseconds: f64,
    /// Part of coal's warm time.
    of_coal_warm: Option<f64>,
    of_coal_cold: Option<f64>,
    mean_iterations: Option<f64>,
    median_iterations: Option<f64>,
    most_iterations: Option<u32>,
    /// Not reported of coal.
    failed: Option<usize>,
    overlaps: Option<usize>,
    targets: Vec<Verdict>,
}

/// A target and what was reached; none where its peer was not run.
#[derive(Serialize)]
struct Verdict {
    target: String,
    at_most: f64,
    reached: Option<f64>,
    met: Option<bool>,
}

impl Report {
    pub(crate) fn new(coal: Option<&Coal>) -> Self {
        Self { machine: Machine::new(coal.map(Coal::version)), tables: Vec::new() }
    }

    pub(crate) fn table(&self, pair: &str, kind: Kind) -> Option<&Table> {
        self.tables.iter().find(|table| table.pair == pair && table.kind == kind)
    }

    pub(crate) fn print_head(&self) {
        self.machine.print();
    }

    pub(crate) fn end(&mut self) {
        self.machine.end();
    }

    /// One line per pair, kind of motion and row; the head says how it was made.
    pub(crate) fn csv(&self, quick: bool) -> String {
        let mut text = self.machine.comments(quick);
        text.push_str("pair,motion,row,ns,iterations_mean,iterations_median,iterations_most,failed,overlaps\n");
        for Table { pair, kind, rows, .. } in &self.tables {
            for line in rows {
                let mean = line.mean_iterations.map_or_else(String::new, |mean| format!("{mean:.4}"));
                let (median, most) = (count(line.median_iterations), count(line.most_iterations));
                let [failed, overlaps] = [line.failed, line.overlaps].map(count);
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{pair},{},\"{}\",{:.1},{mean},{median},{most},{failed},{overlaps}",
                    kind.name(),
                    line.label,
                    line.nanoseconds
                );
            }
        }
        text
    }

    /// The targets that are missed, with their rows.
    pub(crate) fn missed(&self) -> Vec<String> {
        let rows = self.tables.iter().flat_map(|table| table.rows.iter().map(move |line| (table, line)));
        let missed = rows.flat_map(|(Table { pair, kind, .. }, line)| {
            let verdicts = line.targets.iter().filter(|verdict| verdict.met == Some(false));
            verdicts.map(move |verdict| format!("{pair}, {}, {}: {}", kind.name(), line.label, verdict.text()))
        });
        missed.collect()
    }

    pub(crate) fn print_foot(&self) {
        let verdicts = self.tables.iter().flat_map(|table| &table.rows).flat_map(|line| &line.targets);
        let (mut met, mut missed, mut open) = (0, 0, 0);
        for verdict in verdicts {
            match verdict.met {
                Some(true) => met += 1,
                Some(false) => missed += 1,
                None => open += 1,
            }
        }
        println!();
        self.machine.print_load();
        println!("{met} targets met, {missed} missed, {open} without their peer");
    }
}

impl Table {
    /// Gathers the rows; `coal` is cold and warm, in nanoseconds, `separated` the table of the same
    /// pair on those motions.
    pub(crate) fn new(scene: &Scene<'_>, rows: &[Row<'_>], coal: Option<(f64, f64)>, separated: Option<&Self>) -> Self {
        let queries = scene.poses(DEGREE).iter().map(Vec::len).sum();
        let mut times: Vec<(&str, f64)> =
            rows.iter().map(|row| (row.timed.label.as_str(), row.timed.nanoseconds())).collect();
        if let Some((cold, warm)) = coal {
            times.extend([(COAL_COLD, cold), (COAL_WARM, warm)]);
        }
        let time = |label: &str| times.iter().find(|(known, _)| *known == label).map(|(_, time)| *time);
        let line = |label: &str, row: Option<&Row<'_>>| {
            let nanoseconds = time(label).unwrap_or(f64::NAN);
            let counts = row.and_then(|row| row.timed.tally.iterations());
            let verdict = |target: &Target| {
                let (target, at_most, reached) = match *target {
                    Target::PartOf(of, part) => (format!("of {of}"), part, time(of).map(|time| nanoseconds / time)),
                    Target::Nanoseconds(limit) => ("ns".to_owned(), limit, Some(nanoseconds)),
                    Target::OfSeparated(limit) => {
                        let before = separated.and_then(|table| table.nanoseconds(label));
                        ("of separated".to_owned(), limit, before.map(|time| nanoseconds / time))
                    }
                    Target::MeanIterations(limit) => ("iterations".to_owned(), limit, counts.map(|(mean, ..)| mean)),
                    Target::MedianIterations(limit) => {
                        let median = counts.map(|(_, median, _)| median);
                        ("iterations median".to_owned(), f64::from(limit), median)
                    }
                    Target::MostIterations(limit) => {
                        let most = counts.map(|(.., most)| f64::from(most));
                        ("iterations worst".to_owned(), f64::from(limit), most)
                    }
                };
                Verdict { target, at_most, reached, met: reached.map(|value| value <= at_most) }
            };
            Line {
                label: label.to_owned(),
                nanoseconds,
                of_coal_warm: time(COAL_WARM).map(|time| nanoseconds / time),
                of_coal_cold: time(COAL_COLD).map(|time| nanoseconds / time),
                mean_iterations: counts.map(|(mean, ..)| mean),
                median_iterations: counts.map(|(_, median, _)| median),
                most_iterations: counts.map(|(.., most)| most),
                failed: row.map(|row| row.timed.tally.failed),
                overlaps: row.map(|row| row.timed.tally.overlaps),
                targets: row.map_or(&[][..], |row| &row.targets).iter().map(verdict).collect(),
            }
        };
        let mut lines: Vec<Line> = rows.iter().map(|row| line(&row.timed.label, Some(row))).collect();
        if coal.is_some() {
            lines.extend([COAL_COLD, COAL_WARM].map(|label| line(label, None)));
        }
        let (a, b) = scene.pair.bodies(DEGREE);
        Self {
            motion: Character::new(a, b, scene.poses(DEGREE)),
            pair: scene.pair.name.clone(),
            kind: scene.kind,
            hull_vertices: [&scene.pair.a, &scene.pair.b].map(|object| object.hull.len()),
            poses: queries,
            rows: lines,
        }
    }

    /// Time of the row with this label.
    fn nanoseconds(&self, label: &str) -> Option<f64> {
        self.rows.iter().find(|line| line.label == label).map(|line| line.nanoseconds)
    }

    /// Prints the table; times are compared with those of `separated`, if this is another.
    pub(crate) fn print(&self, separated: Option<&Table>) {
        let [a, b] = self.hull_vertices;
        println!("\n{}, {}: {} poses, hulls of {a} and {b} vertices", self.pair, self.kind.name(), self.poses);
        let Character { gaps: [least, middle, most], steps: [step, longest] } = self.motion;
        println!(
            "gaps of degree {DEGREE}: {least:.1e}, median {middle:.3}, {most:.3} m; steps: median {:.2}, longest {:.2} cm",
            100.0 * step,
            100.0 * longest
        );
        println!(
            "{:<32} {:>9} {:>7} {:>7} {:>7} {:>6} {:>6} {:>7} {:>8}  targets",
            "", "ns", "x warm", "x cold", "x sep.", "mean", "worst", "failed", "overlaps"
        );
        for line in &self.rows {
            let before = separated.and_then(|table| table.nanoseconds(&line.label));
            println!(
                "{:<32} {:>9.1} {:>7} {:>7} {:>7} {:>6} {:>6} {:>7} {:>8}  {}",
                line.label,
                line.nanoseconds,
                number(line.of_coal_warm),
                number(line.of_coal_cold),
                number(before.map(|time| line.nanoseconds / time)),
                number(line.mean_iterations),
                count(line.most_iterations),
                count(line.failed),
                count(line.overlaps),
                line.targets.iter().map(Verdict::text).collect::<Vec<_>>().join("; ")
            );
        }
    }
}

impl Verdict {
    fn text(&self) -> String {
        let Self { target, at_most, .. } = self;
        match (self.reached, self.met) {
            (Some(reached), Some(met)) => {
                format!("{} {reached:.2} <= {at_most} {target}", if met { "pass" } else { "MISS" })
            }
            _ => format!("open {at_most} {target}"),
        }
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |value| format!("{value:.2}"))
}

fn count<T: ToString>(value: Option<T>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}
