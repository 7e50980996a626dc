//! The report and the CSV.

use super::Warm;
use super::steps::{Cell, Steps};
use crate::blocks::block;
use crate::comparison::parry_version;
use crate::csv::{MEASURED, significant};
use std::fmt::Write;

impl Warm {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let mut text = String::from("# Warm starts\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench warm --data DIR{flags}")));
        let coal = self.coal.as_ref().map_or("coal did not take part (SUBLEVEL_COAL is not set)".to_owned(), |version| {
            format!("coal {version} is the wheel from PyPI, a generic build, at its default tolerance of 1e-6 m, warm by its cached guess")
        });
        let _ = writeln!(
            text,
            "Peers: {coal}; parry3d-f64 {}, warm by its initial direction. Passes: {}; rows take turns, in each of which a motion is walked nine times on end; medians \
             count; one thread.\n",
            parry_version(),
            self.passes
        );
        let _ = writeln!(
            text,
            "A step of s moves the second object by s times half of the larger diameter and turns it by 100 s degrees, in random directions (seeds 1, \
             2, ... of SplitMix64); `teleport` are poses that have nothing to do with each other. The gap of the widest bodies stays between 0.5 and \
             37 % of the larger diameter.\n"
        );
        for Steps { pair, unit_m, queries, .. } in &self.steps {
            let _ = writeln!(text, "## {pair}\n\nA step of 1 is {unit_m:.3} m; {queries} queries per cell.\n");
            text += &block("warm.csv", pair, "");
            text.push('\n');
        }
        text.push_str("## The chair passes the human\n\n");
        text += &block("warm.csv", "passage", "");
        text
    }

    /// Two tables, an empty line between them.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "pair,who,step,cold_ns,warm_ns,cold_iterations,cold_most,warm_iterations,warm_most,failed,contradictions\n",
        );
        let short = |value: f64| significant(value, MEASURED);
        for Steps { pair, cells, .. } in &self.steps {
            for Cell { who, step, cold, warm, cold_iterations, warm_iterations, failed, contradictions } in cells {
                let step = step.map_or("teleport".into(), |step| step.to_string());
                let counts =
                    |of: &Option<(f64, u32)>| of.map_or(",".into(), |(mean, most)| format!("{},{most}", short(mean)));
                let (cold_count, warm_count) = (counts(cold_iterations), counts(warm_iterations));
                let (name, cold, warm) = (who.name(), short(*cold), short(*warm));
                let _ = writeln!(
                    text,
                    "{pair},\"{name}\",{step},{cold},{warm},{cold_count},{warm_count},{failed},{contradictions}"
                );
            }
        }
        text.push_str("\nposition_m,chair_human,human_chair,bracket_width,cold_ns,warm_ns,cold_iterations,warm_iterations,wrong\n");
        for stop in &self.passage.stops {
            let _ = writeln!(
                text,
                "{},{},{},{:e},{},{},{},{},{}",
                short(stop.position_m),
                short(stop.levels[0]),
                short(stop.levels[1]),
                short(stop.width),
                short(stop.cold),
                short(stop.warm),
                stop.cold_iterations,
                stop.warm_iterations,
                stop.wrong
            );
        }
        text
    }
}
