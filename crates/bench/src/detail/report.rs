//! The report and the CSV.

use super::questions::THRESHOLDS;
use super::rungs::{Ladder, Rung};
use super::{Detail, parts_report};
use crate::blocks::block;
use crate::csv::{MEASURED, significant};
use std::fmt::Write;

impl Detail {
    /// One line per object, number of parts and way to divide it.
    pub fn parts_csv(&self) -> String {
        parts_report::csv(&self.divided)
    }

    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let mut text = String::from("# What each level of detail buys\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench detail --data DIR{flags}")));
        let _ = writeln!(text, "![detail](detail.svg)\n");
        text += &block("detail.csv", "notes", "");
        let _ = writeln!(text, "- {} questions per threshold.", self.questions);
        for Ladder { pair, diameter_m, queries, .. } in &self.ladders {
            let _ = writeln!(text, "\n## {pair}\n\nLarger diameter {diameter_m:.3} m, {queries} poses.\n");
            text += &block("detail.csv", pair, "");
        }
        text.push('\n');
        text += &parts_report::markdown();
        text
    }

    /// One line per pair, rung and threshold.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "pair,rung,error_mean,error_max,gap,iterations_cold,iterations_warm,cold_ns,warm_ns,batch_ns,failed,wrong,threshold,yes,no,contradicted\n",
        );
        for Ladder { pair, rungs, .. } in &self.ladders {
            for rung in rungs {
                let Rung { name, failed, wrong, settled, .. } = rung;
                let short = |value: f64| significant(value, MEASURED);
                let (error, gap, batch) = (rung.error.map(short), short(rung.gap), short(rung.batch));
                let (iterations, nanoseconds) = (rung.iterations.map(short), rung.nanoseconds.map(short));
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
