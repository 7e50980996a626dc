//! The report and the CSV.

use super::methods::Cell;
use super::{Accuracy, Measured};
use crate::blocks::block;
use crate::comparison::parry_version;
use crate::csv::significant;
use crate::machine::locked;
use std::fmt::Write;

/// Decimal digits of errors and widths, which are drawn over many powers of ten.
const DIGITS: usize = 3;

impl Accuracy {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let mut text = String::from("# Solver accuracy against time\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench accuracy --data DIR{flags}")));
        let part = |name: &str, version: &Option<String>, hint: &str| {
            version.as_ref().map_or(format!("{name} did not take part ({hint})"), |version| format!("{name} {version}"))
        };
        let _ = writeln!(
            text,
            "Peers: {}; {}; slsqp {}; parry3d-f64 {}. Passes: {}; rows take turns, medians count.\n",
            part(
                "clarabel",
                &self.solver,
                "`cargo build --release -p sublevel-bench --example clarabel` makes its program"
            ),
            part("coal", &self.coal, "SUBLEVEL_COAL is not set"),
            locked("slsqp"),
            parry_version(),
            self.passes
        );
        text += &block("accuracy.csv", "notes", "");
        text.push('\n');
        text += &block("accuracy.csv", "all cases", "");
        for Measured { name, size_m, queries, reference, .. } in &self.cases {
            let _ = writeln!(
                text,
                "\n## {name}\n\nCircumradius of the smaller body {size_m:.3} m, {queries} poses; half of the reference's bracket: {:.0e}, at most {:.0e}.\n",
                reference[0], reference[1]
            );
            text += &block("accuracy.csv", name, "");
        }
        text
    }

    /// One line per case, method and setting.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "case,method,setting,queries,ns,iterations,error_median,error_max,width_median,width_max,off,short\n",
        );
        for case in &self.cases {
            for cell in &case.cells {
                let Cell { method, setting, queries, nanoseconds, iterations, error, width, off, short } = cell;
                let name = method.name();
                let announce = |value: Option<f64>| {
                    value.map_or(String::new(), |value| format!("{:e}", significant(value, DIGITS)))
                };
                let widths = width.map_or([None; 2], |width| width.map(Some)).map(announce).join(",");
                let errors = error.map(|error| announce(Some(error))).join(",");
                let _ = writeln!(
                    text,
                    "{},{name},{setting},{queries},{nanoseconds:.1},{},{errors},{widths},{off},{}",
                    case.name,
                    announce(*iterations),
                    short.map_or(String::new(), |short| short.to_string())
                );
            }
        }
        text
    }
}
