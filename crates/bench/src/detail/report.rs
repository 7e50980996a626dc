//! The report and its pictures.

use super::questions::THRESHOLDS;
use super::rungs::{Ladder, Rung};
use super::{Detail, parts_report};
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

const NOTES: &str = "\
- Error: distance of the convex hulls less that of the rung, mean and largest over the poses; gap: how far both bodies together reach \
beyond their hulls at most, proven. All as parts of the larger diameter. Poses as in the chart of speed against accuracy, with the balls \
apart too. wrong: brackets that do not hold the distance of the hulls once widened by the gap.
- Questions: `nearer than m?` for random directions and rotations, at hull distances that are uniform between 0 and 2 m (touching: between 0 and \
one diameter). A rung settles it by no if its bracket lies above m, by yes if its bracket with the gap added lies below. m is in larger diameters.
";

impl Detail {
    /// The pictures by name.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if nothing was measured.
    pub fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = vec![("detail.svg".to_owned(), self.costs()?)];
        for ladder in &self.ladders {
            all.push((format!("detail-{}.svg", ladder.pair), ladder.open_questions()?));
        }
        all.push(("detail-parts.svg".to_owned(), parts_report::picture(&self.divided)?));
        Ok(all)
    }

    /// One line per object, number of parts and way to divide it.
    pub fn parts_csv(&self) -> String {
        parts_report::csv(&self.divided)
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

    /// The report; the pictures lie beside it under these names.
    pub fn markdown(&self, pictures: &[&str]) -> String {
        let mut text = String::from("# What each level of detail buys\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench detail --data DIR{flags}")));
        let _ = writeln!(text, "![detail](detail.svg)\n\n{NOTES}- {} questions per threshold.\n", self.questions);
        for ladder in &self.ladders {
            ladder.write(&mut text);
            let name = format!("detail-{}.svg", ladder.pair);
            if pictures.contains(&name.as_str()) {
                let _ = writeln!(text, "![{name}]({name})\n");
            }
        }
        let picture = pictures.iter().copied().find(|name| *name == "detail-parts.svg");
        text += &parts_report::markdown(&self.divided, picture);
        text
    }

    /// One line per pair, rung and threshold.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "pair,rung,error_mean,error_max,gap,iterations_cold,iterations_warm,cold_ns,warm_ns,batch_ns,failed,wrong,threshold,yes,no,contradicted\n",
        );
        for Ladder { pair, rungs, .. } in &self.ladders {
            for rung in rungs {
                let Rung { name, error, gap, iterations, nanoseconds, batch, failed, wrong, settled } = rung;
                for (threshold, settled) in THRESHOLDS.iter().zip(settled) {
                    let _ = writeln!(
                        text,
                        "{pair},{name},{:e},{:e},{gap:e},{},{},{},{},{batch},{failed},{wrong},{threshold},{:.4},{:.4},{}",
                        error[0],
                        error[1],
                        iterations[0],
                        iterations[1],
                        nanoseconds[0],
                        nanoseconds[1],
                        settled.yes,
                        settled.no,
                        settled.wrong
                    );
                }
            }
        }
        text
    }
}

impl Ladder {
    fn write(&self, text: &mut String) {
        let Self { pair, diameter_m, queries, rungs } = self;
        let _ = writeln!(
            text,
            "## {pair}\n\nLarger diameter {diameter_m:.3} m, {queries} poses.\n\n\
             | rung | mean error | largest | gap | iterations cold | warm | cold ns | warm ns | batch ns | failed | wrong |\n\
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
        text.push('\n');
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
