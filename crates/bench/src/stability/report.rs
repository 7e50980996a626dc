//! The table as Markdown and CSV, and what was lost against an earlier one.

use super::method::Method;
use super::question::Verdict;
use super::runner::{Cell, PATIENCE};
use super::table::{Row, Stability};
use crate::comparison::parry_version;
use std::fmt::Write;
use std::str::FromStr;

/// Heading of the CSV.
const HEAD: &str = "family,name,method,cases,failed,off,worst,wrong_status,no_answer,hang,crash,first,failed_seeds";

/// The table to guard against cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line} is not one of a stability table ({HEAD}); give the stability.csv of an earlier run")]
pub struct GuardError {
    line: usize,
}

/// What failed in an earlier run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Earlier {
    cells: Vec<EarlierCell>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct EarlierCell {
    family: u8,
    method: Method,
    /// Seeds of the failures.
    failed: Vec<u64>,
}

impl FromStr for Earlier {
    type Err = GuardError;

    /// Reads the CSV of a run.
    fn from_str(text: &str) -> Result<Self, GuardError> {
        let cell = |line: &str| {
            // Names contain commas.
            let (number, rest) = line.split_once(",\"")?;
            let (_, rest) = rest.split_once("\",")?;
            let (method, seeds) = (rest.split(',').next()?, rest.rsplit(',').next()?);
            let failed = seeds.split_whitespace().map(|seed| seed.parse().ok()).collect::<Option<_>>()?;
            Some(EarlierCell { family: number.parse().ok()?, method: method.parse().ok()?, failed })
        };
        let mut lines = text.lines().zip(1..);
        match lines.next() {
            Some((HEAD, _)) => {}
            _ => return Err(GuardError { line: 1 }),
        }
        let cells = lines.map(|(line, at)| cell(line).ok_or(GuardError { line: at })).collect::<Result<_, _>>()?;
        Ok(Self { cells })
    }
}

/// What one of our cells lost.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Lost {
    /// Number and name of the family.
    pub family: String,
    /// The column.
    pub method: &'static str,
    /// What, and how to see it.
    pub what: String,
}

impl Cell {
    fn count(&self, kind: &str) -> usize {
        self.failures.iter().filter(|(_, verdict)| verdict.kind() == kind).count()
    }

    /// The largest error.
    fn worst(&self) -> Option<f64> {
        let errors = self.failures.iter().filter_map(|(_, verdict)| match verdict {
            Verdict::Off(error) => Some(*error),
            _ => None,
        });
        errors.reduce(|a, b| if a.total_cmp(&b).is_lt() { b } else { a })
    }

    fn text(&self) -> String {
        let Self { cases, left_out, failures, .. } = self;
        if failures.is_empty() {
            return format!("pass ({cases})");
        }
        let rest = if *left_out > 0 { format!("; {left_out} not put any more") } else { String::new() };
        let mut parts = Vec::new();
        if let Some(worst) = self.worst() {
            parts.push(format!("off by up to {worst:.0e}"));
        }
        for kind in ["wrong status", "no answer", "hang", "crash"] {
            let count = self.count(kind);
            if count > 0 {
                parts.push(format!("{count} {kind}"));
            }
        }
        format!("**{} of {cases}**: {}{rest}", failures.len(), parts.join(", "))
    }
}

impl Row {
    fn cell(&self, method: Method) -> Option<&Cell> {
        self.cells.iter().find(|cell| cell.method == method)
    }
}

impl Stability {
    /// The report.
    pub fn markdown(&self) -> String {
        let mut text = String::from("# Stability where methods fail\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(
            text,
            "{}\n",
            self.machine.head_with(&format!("sublevel-bench stability{flags}"), "all of which are used")
        );
        let coal =
            self.coal.as_ref().map_or("coal did not take part (SUBLEVEL_COAL is not set)".to_owned(), |version| {
                format!("coal {version} at its default tolerance of 1e-6 m")
            });
        let solver = self
            .solver
            .as_ref()
            .map_or("clarabel did not take part (its example is not built)".to_owned(), |version| {
                format!("clarabel {version}")
            });
        let _ = writeln!(
            text,
            "Peers: parry3d-f64 {}; {coal}; {solver}. In place of a body, GJK gets the convex hull of 1 000 points of its surface, and is held to the distance \
             of these hulls; others may be wrong by 1e-5 of the smaller body. Newton does 100 undamped steps from where the line of centres leaves the bodies, SLSQP \
             1 000 evaluations from there, bodies of one constraint both; clarabel has its default tolerance of 1e-8. Ours must hold the truth in its bracket, be as narrow as asked for \
             and say so; where a family asks for more, it must do that. Each case is drawn from its seed alone and put in a child process that is stopped \
             after {} s without an answer, for the third time with the rest of its cases; the truth lies between the nearest points inside and the \
             farthest parallel planes between the bodies that the answer, a tight answer of ours or directions all around propose, which must all but meet. \
             Times impact: parry's nonlinear shape cast of a box and a ball. Depths: parry's EPA on the hulls.\n",
            parry_version(),
            PATIENCE.as_secs()
        );
        text.push_str(&self.table());
        text.push_str(
            "\nErrors are relative to the smaller body, of normals in radians, of gradients relative to their norm, of times to the whole turn. \
             `-`: the method cannot be asked. Families 17, 23 and 24 are about scenes, which are not measured here. \
             The hulls lie inside of the bodies: where these touch, those are about a thousandth apart, so that the rows about contact ask less of GJK. \
             Cases of 1, 7, 10, 11, 15 and 19 are of several answers, which must also go together; of those of 4 others than ours get the first pair. \
             Of signed, level and growth distances, impacts and fits only ours and those of parry's that are named here are asked. \
             Rows from 101 on are the family of the last two digits between primitives: boxes, cylinders, balls, ellipsoids, capsules, segments, points and \
             half-spaces, each with most others and beside smooth bodies; ours are judged by 200 bits, and gradients compared with those. There GJK gets the \
             primitives themselves, parry all and coal all but points and half-spaces, which its program does not take, and hulls of ellipsoids and smooth bodies. \
             No polynomial has a capsule, a point or a half-space for its set: of those rows Newton, SLSQP and clarabel get the pairs of bodies. \
             Batches are of bodies, and capsules beside each other or a half-space take no hint. There is no 122 and no 126: of capsules no time of impact is measured, and fits are of points. \
             The tests of the families ask ours the same against references of 200 bits.\n\n\
             ## Failures\n\nThe first of each cell, by the command that replays it.\n\n",
        );
        for row in &self.rows {
            for cell in &row.cells {
                if let Some((seed, verdict)) = cell.failures.first() {
                    let _ = writeln!(text, "- `{}`: {}", replay(row, cell.method, *seed), verdict);
                }
            }
        }
        text
    }

    /// A row per family, a column per method.
    pub fn table(&self) -> String {
        let mut text = String::from("| | family |");
        for method in Method::ALL {
            let _ = write!(text, " {} |", method.title());
        }
        text.push_str("\n|---|---|");
        text.push_str(&"---|".repeat(Method::ALL.len()));
        text.push('\n');
        for row in &self.rows {
            let _ = write!(text, "| {} | {} |", row.number, row.name);
            for method in Method::ALL {
                let _ = write!(text, " {} |", row.cell(method).map_or("-".into(), Cell::text));
            }
            text.push('\n');
        }
        text
    }

    /// One line per cell.
    pub fn csv(&self) -> String {
        let mut text = format!("{HEAD}\n");
        for row in &self.rows {
            for cell in &row.cells {
                let Cell { method, cases, left_out: _, failures } = cell;
                let worst = cell.worst().map_or(String::new(), |worst| format!("{worst:e}"));
                let first = failures.first().map_or(String::new(), |(_, verdict)| verdict.to_string());
                let seeds: Vec<String> = failures.iter().map(|(seed, _)| seed.to_string()).collect();
                let _ = writeln!(
                    text,
                    "{},\"{}\",{},{cases},{},{},{worst},{},{},{},{},\"{}\",{}",
                    row.number,
                    row.name,
                    method.name(),
                    failures.len(),
                    cell.count("off"),
                    cell.count("wrong status"),
                    cell.count("no answer"),
                    cell.count("hang"),
                    cell.count("crash"),
                    first.replace('"', "'"),
                    seeds.join(" ")
                );
            }
        }
        text
    }

    /// What our cells lost against an earlier run: cases that fail now and did not then, and cells
    /// that are not put any more.
    pub fn lost_against(&self, earlier: &Earlier) -> Vec<Lost> {
        let mut lost = Vec::new();
        for row in &self.rows {
            for method in self.methods.iter().copied().filter(|method| method.is_ours()) {
                let before = earlier.cells.iter().find(|cell| cell.family == row.number && cell.method == method);
                let known = before.map_or(&[][..], |cell| &cell.failed);
                let what = match (row.cell(method), before) {
                    (None, Some(_)) => Some("is not put any more".to_owned()),
                    (None, None) => None,
                    (Some(cell), _) => {
                        let mut new = cell.failures.iter().filter(|(seed, _)| !known.contains(seed));
                        new.next().map(|(seed, verdict)| format!("{verdict}; {}", replay(row, method, *seed)))
                    }
                };
                let family = format!("{} ({})", row.number, row.name);
                lost.extend(what.map(|what| Lost { family, method: method.title(), what }));
            }
        }
        lost
    }
}

fn replay(row: &Row, method: Method, seed: u64) -> String {
    format!("sublevel-bench stability --replay {}/{}/{seed}", row.number, method.name())
}
