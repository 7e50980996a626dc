//! What pages show of `measures.csv`, which `cargo bench --bench measures -- --csv FILE` writes:
//! times of all measures beside coal and parry.

use crate::csv::{CsvError, Table};
use crate::words::Span;
use std::fmt::Write;

/// The pairs, in the order of the columns.
const PAIRS: [&str; 3] = ["chair-human", "hand-vase", "octopus-chair"];

const COAL_CACHED: &str = "coal GJK warm";
const COAL_COLD: &str = "coal GJK cold";
const BATCHES: &str = "distance batches, degree 6";

/// A run.
pub(crate) struct Shown {
    /// Command, machine, commit and peers.
    head: String,
    lines: Vec<Line>,
    /// Another run, with narrower vectors.
    narrow: Option<Vec<Line>>,
}

/// A row of one pair on one kind of motion.
struct Line {
    pair: String,
    motion: String,
    row: String,
    nanoseconds: f64,
    median_iterations: Option<f64>,
}

impl Shown {
    /// Reads a run, and one with narrower vectors if there is one.
    pub(crate) fn read(text: &str, narrow: Option<&str>) -> Result<Self, CsvError> {
        let comments = text.lines().filter_map(|line| line.strip_prefix("# "));
        let head = comments.map(|line| format!("{line}\n")).collect();
        Ok(Self { head, lines: lines(text)?, narrow: narrow.map(lines).transpose()? })
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        match name {
            "head" => Some(self.head.clone()),
            "table" => self.table(),
            "table in short" => self.short_table(),
            "degree 2" => self.degree_2(),
            _ => None,
        }
    }

    fn table(&self) -> Option<String> {
        let mut text = head("degree 6 unless said");
        let mut row = |name: &str, cell: &dyn Fn(&str) -> Option<String>| {
            push(&mut text, name, cell);
        };
        let warm = |degree: usize| format!("distance warm, degree {degree}");
        row("coal, cached / cold", &|pair| self.coal(pair));
        row("parry warm, of coal cached", &|pair| self.of(pair, "parry GJK warm", COAL_CACHED));
        row("distance warm", &|pair| self.time(pair, "separated", &warm(6)));
        for degrees in [[2, 4], [6, 8]] {
            let name = format!("distance warm, degree {} / {}, of coal cached", degrees[0], degrees[1]);
            row(&name, &|pair| both(degrees.map(|degree| self.of(pair, &warm(degree), COAL_CACHED))));
        }
        row("distance warm, grazing over separated, degree 2 / 4 / 6 / 8", &|pair| {
            both([2, 4, 6, 8].map(|degree| self.grazing(pair, &warm(degree))))
        });
        row("distance cold, of coal cold", &|pair| self.of(pair, "distance cold, degree 6", COAL_COLD));
        row("distance cold, grazing over separated, degree 6 / 8", &|pair| {
            both([6, 8].map(|degree| self.grazing(pair, &format!("distance cold, degree {degree}"))))
        });
        row("level distance warm, of coal cached", &|pair| self.of(pair, "level distance warm, degree 6", COAL_CACHED));
        row("distances in a batch of 1 024", &|pair| self.time(pair, "separated", BATCHES));
        row("the same, of coal cached", &|pair| self.of(pair, BATCHES, COAL_CACHED));
        row("the same, grazing", &|pair| self.time(pair, "grazing", BATCHES));
        if let Some(narrow) = &self.narrow {
            let time = |pair: &str, name: &str| nanoseconds(narrow, pair, "separated", name);
            row("the same with AVX2 (`SUBLEVEL_SIMD=avx2`), separated", &|pair| Some(in_ns(time(pair, BATCHES)?)));
            row("the same, of coal cached in that run", &|pair| {
                Some(format!("{:.2}", time(pair, BATCHES)? / time(pair, COAL_CACHED)?))
            });
        }
        row("growth distance warm", &|pair| self.time(pair, "separated", "growth distance warm, degree 6"));
        row("signed distance warm, apart", &|pair| self.time(pair, "separated", "signed distance warm, degree 6"));
        row("ray cast, hits", &|pair| self.time(pair, "separated", "ray cast, hits, degree 6"));
        row("penetration depth", &|pair| self.depth(pair));
        row("time of impact, distance queries (median)", &|pair| {
            let line = self.line(pair, "separated", "time of impact, degree 6")?;
            Some(line.median_iterations?.to_string())
        });
        // A row without a number is a run that left something out: no table then.
        (!text.contains("| - |")).then_some(text)
    }

    fn short_table(&self) -> Option<String> {
        let mut text = head("");
        let mut row = |name: &str, cell: &dyn Fn(&str) -> Option<String>| push(&mut text, name, cell);
        row("coal, with its guess from the pose before / cold", &|pair| self.coal(pair));
        row("parry, with its direction from the pose before, of coal's time", &|pair| {
            self.of(pair, "parry GJK warm", COAL_CACHED)
        });
        row("distance with a hint from the pose before", &|pair| {
            self.time(pair, "separated", "distance warm, degree 6")
        });
        row("distance cold, of coal's cold time", &|pair| self.of(pair, "distance cold, degree 6", COAL_COLD));
        row("distance in a batch of 1024 poses", &|pair| self.time(pair, "separated", BATCHES));
        row("penetration depth, to 1e-3", &|pair| self.depth(pair));
        text.push('\n');
        text += &self.head;
        (!text.contains("| - |")).then_some(text)
    }

    /// Where the polynomial is not what costs.
    fn degree_2(&self) -> Option<String> {
        let warm = "distance warm, degree 2";
        let times = PAIRS.map(|pair| self.line(pair, "separated", warm).map(|line| line.nanoseconds));
        let times = Span::of(times.into_iter().flatten())?.text(0);
        Some(format!(
            "At degree 2 the warm distance takes {times} ns: there the arithmetic of poses, Newton's step and the bracket, one\n\
             chain of dependent operations, outweighs the polynomial.\n"
        ))
    }

    fn line(&self, pair: &str, motion: &str, row: &str) -> Option<&Line> {
        find(&self.lines, pair, motion, row)
    }

    fn time(&self, pair: &str, motion: &str, row: &str) -> Option<String> {
        self.line(pair, motion, row).map(|line| in_ns(line.nanoseconds))
    }

    /// As a part of the time of another row, on separated motions.
    fn of(&self, pair: &str, row: &str, other: &str) -> Option<String> {
        let part =
            nanoseconds(&self.lines, pair, "separated", row)? / nanoseconds(&self.lines, pair, "separated", other)?;
        Some(if part < 2.0 { format!("{part:.2}") } else { format!("{part:.1}") })
    }

    fn grazing(&self, pair: &str, row: &str) -> Option<String> {
        let time = |motion: &str| nanoseconds(&self.lines, pair, motion, row);
        Some(format!("{:.1}", time("grazing")? / time("separated")?))
    }

    fn coal(&self, pair: &str) -> Option<String> {
        let time = |row: &str| nanoseconds(&self.lines, pair, "separated", row);
        Some(format!("{:.0} / {}", time(COAL_CACHED)?, in_ns(time(COAL_COLD)?)))
    }

    fn depth(&self, pair: &str) -> Option<String> {
        let line = self.line(pair, "contact", "penetration cold, degree 6")?;
        Some(format!("{:.0} µs", 1e-3 * line.nanoseconds))
    }
}

fn lines(text: &str) -> Result<Vec<Line>, CsvError> {
    let table = Table::read(text)?;
    let line = |row: crate::csv::Row<'_>| {
        Ok(Line {
            pair: row.get("pair")?,
            motion: row.get("motion")?,
            row: row.get("row")?,
            nanoseconds: row.get("ns")?,
            median_iterations: row.maybe("iterations_median")?,
        })
    };
    table.rows().map(line).collect()
}

fn find<'a>(lines: &'a [Line], pair: &str, motion: &str, row: &str) -> Option<&'a Line> {
    lines.iter().find(|line| line.pair == pair && line.motion == motion && line.row == row)
}

fn nanoseconds(lines: &[Line], pair: &str, motion: &str, row: &str) -> Option<f64> {
    find(lines, pair, motion, row).map(|line| line.nanoseconds)
}

fn in_ns(nanoseconds: f64) -> String {
    format!("{nanoseconds:.0} ns")
}

fn head(corner: &str) -> String {
    let corner = if corner.is_empty() { String::new() } else { format!(" {corner}") };
    format!("|{corner} | {} |\n|---|---|---|---|\n", PAIRS.join(" | "))
}

fn push(text: &mut String, name: &str, cell: &dyn Fn(&str) -> Option<String>) {
    let cells = PAIRS.map(|pair| cell(pair).unwrap_or_else(|| "-".into()));
    // Writing to a string cannot fail.
    let _ = writeln!(text, "| {name} | {} |", cells.join(" | "));
}

/// Several numbers in a cell.
fn both<const N: usize>(numbers: [Option<String>; N]) -> Option<String> {
    let numbers: Vec<String> = numbers.into_iter().collect::<Option<_>>()?;
    Some(numbers.join(" / "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "# Made by a test.\n# Peers: none.\npair,motion,row,ns,iterations_median\n";

    fn csv(rows: &[(&str, &str, f64)]) -> String {
        let mut text = HEAD.to_owned();
        for pair in PAIRS {
            for (motion, row, ns) in rows {
                let _ = writeln!(text, "{pair},{motion},\"{row}\",{ns},");
            }
        }
        text
    }

    #[test]
    fn tables_have_times_and_parts_of_one_run() {
        let rows = [
            ("separated", COAL_CACHED, 1000.0),
            ("separated", COAL_COLD, 2000.0),
            ("separated", "parry GJK warm", 5600.0),
            ("separated", "distance warm, degree 6", 250.4),
            ("separated", "distance warm, degree 2", 200.0),
            ("separated", "distance cold, degree 6", 900.0),
            ("separated", BATCHES, 120.0),
            ("contact", "penetration cold, degree 6", 40_400.0),
        ];
        let shown = Shown::read(&csv(&rows), None).unwrap();
        assert_eq!(shown.block("head").unwrap(), "Made by a test.\nPeers: none.\n");
        let table = shown.block("table in short").unwrap();
        for cells in ["1000 / 2000 ns", "| 5.6 |", "| 250 ns |", "| 0.45 |", "| 120 ns |", "| 40 µs |"] {
            assert!(table.contains(cells), "{cells}: {table}");
        }
        assert!(shown.block("degree 2").unwrap().contains("takes 200 ns"));
        // Rows that were not measured are not made up.
        assert_eq!(shown.block("table"), None);
        let some = Shown::read(&csv(&rows[..3]), None).unwrap();
        assert_eq!((some.block("table in short"), some.block("degree 2"), some.block("other")), (None, None, None));
    }
}
