//! What pages show of `detail.csv`: tables and pictures.

use super::questions::{Settled, THRESHOLDS};
use super::rungs::{Ladder, RUNGS, Rung};
use crate::csv::{CsvError, Row, Table};
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

const NOTES: &str = "\
- Error: distance of the convex hulls less that of the rung, mean and largest over the poses; gap: how far both bodies together reach \
beyond their hulls at most, proven. All as parts of the larger diameter. Poses as in the chart of speed against accuracy, with the balls \
apart too. wrong: brackets that do not hold the distance of the hulls once widened by the gap.
- Questions: `nearer than m?` for random directions and rotations, at hull distances that are uniform between 0 and 2 m (touching: between 0 and \
one diameter). A rung settles it by no if its bracket lies above m, by yes if its bracket with the gap added lies below. m is in larger diameters.
";

/// The pairs of a CSV.
pub(crate) struct Shown {
    ladders: Vec<Ladder>,
}

impl Shown {
    /// Reads what [`Detail::csv`](super::Detail::csv) wrote: a line for each threshold of a rung.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let mut ladders: Vec<Ladder> = Vec::new();
        for row in Table::read(csv)?.rows() {
            let pair = row.text("pair")?;
            if ladders.last().is_none_or(|ladder| ladder.pair != pair) {
                // The CSV does not hold the diameter and the number of queries, which no block
                // shows.
                let (diameter_m, queries) = (f64::NAN, 0);
                ladders.push(Ladder { pair: pair.to_owned(), diameter_m, queries, rungs: Vec::new() });
            }
            let (name, settled) = (row.text("rung")?, settled(&row)?);
            let Some(Ladder { rungs, .. }) = ladders.last_mut() else { continue };
            match rungs.last_mut().filter(|rung| rung.name == name) {
                Some(rung) => rung.settled.push(settled),
                None => rungs.push(Rung { settled: vec![settled], ..rung(&row)? }),
            }
        }
        Ok(Self { ladders })
    }

    /// The pictures by name, the most telling first.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = vec![("detail.svg".to_owned(), self.costs()?)];
        for ladder in &self.ladders {
            all.push((ladder.picture(), ladder.open_questions()?));
        }
        Ok(all)
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        if name == "notes" {
            return Some(NOTES.to_owned());
        }
        let ladder = self.ladders.iter().find(|ladder| ladder.pair == name)?;
        let mut text = String::new();
        ladder.write(&mut text);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "\n![{0}]({0})", ladder.picture());
        Some(text)
    }

    /// Error and gap of every rung against its time, warm: geometric means over the pairs.
    fn costs(&self) -> Result<String, ChartError> {
        let Some(first) = self.ladders.first() else { return Err(ChartError::Empty) };
        let mean = |of: &dyn Fn(&Rung) -> f64, k: usize| {
            let logs = self.ladders.iter().filter_map(|ladder| ladder.rungs.get(k)).map(|rung| of(rung).ln());
            (logs.sum::<f64>() / self.ladders.len() as f64).exp()
        };
        let group = |label: &str, ink, marker, named: bool, of: &dyn Fn(&Rung) -> f64| Group {
            label: label.into(),
            ink,
            marker,
            points: first
                .rungs
                .iter()
                .enumerate()
                .map(|(k, rung)| Point {
                    x: mean(of, k),
                    y: mean(&|rung| 1e-3 * rung.nanoseconds[1], k),
                    label: if named { rung.name.into() } else { String::new() },
                })
                .collect(),
            joined: true,
        };
        Scatter {
            title: format!("Rungs of the ladder, geometric means over {} pairs", self.ladders.len()),
            x_label: "part of the larger diameter".into(),
            y_label: "time of a query with a hint (µs)".into(),
            groups: vec![
                group("mean model error", Ink::Blue, Marker::Disc, true, &|rung| rung.error[0]),
                group("largest model error", Ink::Green, Marker::Triangle, false, &|rung| rung.error[1]),
                group("proven gap of both bodies", Ink::Orange, Marker::Ring, false, &|rung| rung.gap),
            ],
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }
}

/// A rung without its questions.
fn rung(row: &Row<'_>) -> Result<Rung, CsvError> {
    let name = row.text("rung")?;
    let name = RUNGS.into_iter().find(|known| *known == name);
    Ok(Rung {
        name: name.ok_or_else(|| row.error("no such rung"))?,
        error: [row.number("error_mean")?, row.number("error_max")?],
        gap: row.number("gap")?,
        iterations: [row.number("iterations_cold")?, row.number("iterations_warm")?],
        nanoseconds: [row.number("cold_ns")?, row.number("warm_ns")?],
        batch: row.number("batch_ns")?,
        failed: row.get("failed")?,
        wrong: row.get("wrong")?,
        settled: Vec::new(),
    })
}

fn settled(row: &Row<'_>) -> Result<Settled, CsvError> {
    Ok(Settled { yes: row.number("yes")?, no: row.number("no")?, wrong: row.get("contradicted")? })
}

impl Ladder {
    fn picture(&self) -> String {
        format!("detail-{}.svg", self.pair)
    }

    fn write(&self, text: &mut String) {
        let rungs = &self.rungs;
        let _ = writeln!(
            text,
            "| rung | mean error | largest | gap | iterations cold | warm | cold ns | warm ns | batch ns | failed | wrong |\n\
             |---|---|---|---|---|---|---|---|---|---|---|"
        );
        for rung in rungs {
            let [mean, most, gap] =
                [rung.error[0], rung.error[1], rung.gap].map(|part| format!("{:.2} %", 100.0 * part));
            let _ = writeln!(
                text,
                "| {} | {mean} | {most} | {gap} | {:.2} | {:.2} | {:.0} | {:.0} | {:.0} | {} | {} |",
                rung.name,
                rung.iterations[0],
                rung.iterations[1],
                rung.nanoseconds[0],
                rung.nanoseconds[1],
                rung.batch,
                rung.failed,
                rung.wrong
            );
        }
        let heads = THRESHOLDS.map(|m| if m > 0.0 { m.to_string() } else { "touching".into() });
        let _ = writeln!(
            text,
            "\nQuestions settled, of those that were asked:\n\n| rung, m = | {} |\n|---{}|",
            heads.join(" | "),
            "|---".repeat(heads.len())
        );
        for rung in rungs {
            let cells: Vec<String> = rung.settled.iter().map(|s| format!("{:.1} %", 100.0 * (s.yes + s.no))).collect();
            let _ = writeln!(text, "| {} | {} |", rung.name, cells.join(" | "));
        }
    }

    /// Part of the questions that each rung leaves open, against the threshold.
    fn open_questions(&self) -> Result<String, ChartError> {
        let styles = [
            (Ink::Grey, Marker::Cross),
            (Ink::Orange, Marker::Ring),
            (Ink::Green, Marker::Triangle),
            (Ink::Blue, Marker::Disc),
            (Ink::Purple, Marker::Ring),
        ];
        let groups = self.rungs.iter().zip(styles).map(|(rung, (ink, marker))| {
            let asked = THRESHOLDS.iter().zip(&rung.settled);
            let open = asked.map(|(m, s)| Point { x: *m, y: 100.0 * (1.0 - s.yes - s.no), label: String::new() });
            // Rounding leaves crumbs of nothing.
            Group {
                label: rung.name.into(),
                ink,
                marker,
                points: open.filter(|point| point.y > 1e-9).collect(),
                joined: true,
            }
        });
        Scatter {
            title: format!("{}: questions \"nearer than m?\" that a rung leaves open", self.pair),
            x_label: "m (larger diameters)".into(),
            y_label: "left open (%)".into(),
            groups: groups.collect(),
            stairs: Vec::new(),
            edge: Some("touching".into()),
            named: None,
        }
        .to_svg()
    }
}
