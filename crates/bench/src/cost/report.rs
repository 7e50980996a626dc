//! The report and the CSV.

use super::Cost;
use super::growth::{Growth, Unit};
use crate::blocks::block;
use std::fmt::Write;

const NOTES: &str = "\
Exponents are slopes of least squares through the logarithms, over the sizes from the geometric mean of the least and the largest on: the cost grows like that power of \
the size there. An exponent of a short range, such as of degrees, is a description of it and no law.

- Queries: distances to 1e-9 of the smaller circumradius at poses that are a hundredth of half the larger diameter and a degree apart (seeds 1, 2, ... of \
SplitMix64), cold and with the hint of the pose before, the same poses for all sizes; means per query, medians over passes, one thread.
- Memory of a solid: the slope of resident memory over many copies of it; a query allocates nothing.
- Fits: time of the fit alone, all its proofs made; memory is the peak of a process that reads the points and fits them (VmHWM).
";

impl Cost {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let mut text = String::from("# How costs grow\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench cost --data DIR{flags}")));
        let _ = writeln!(text, "Passes: {}.\n\n{NOTES}", self.passes);
        text += &block("cost.csv", "exponents", "");
        for Growth { axis, what, .. } in &self.growths {
            let _ = writeln!(text, "\n## {}\n\n{what}\n", axis.title);
            text += &block("cost.csv", axis.key, "");
        }
        text
    }

    /// One line per point; the exponent is that of its curve.
    pub fn csv(&self) -> String {
        let mut text = String::from("against,curve,unit,size,cost,exponent\n");
        for growth in &self.growths {
            for line in &growth.lines {
                let unit = match line.unit {
                    Unit::Nanoseconds => "ns",
                    Unit::Bytes => "bytes",
                };
                for (size, cost) in &line.points {
                    let _ = writeln!(
                        text,
                        "{},\"{}\",{unit},{size},{cost:.1},{:.3}",
                        growth.axis.key,
                        line.name,
                        line.exponent().unwrap_or(f64::NAN)
                    );
                }
            }
        }
        text
    }
}
