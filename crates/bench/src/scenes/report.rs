//! The report and the CSV.

use std::fmt::Write;

use super::Scenes;
use super::bricks::RUNS;
use super::calls::Call;
use super::ticks::{TICKS, Tick};
use crate::blocks::block;

impl Scenes {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let mut text = String::from("# Scenes and questions\n\n");
        let flags = if self.quick { " --quick" } else { "" };
        let command = format!("sublevel-bench scenes --data DIR{flags}");
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}\n", self.machine.head_with(&command, "all of which are used"));
        let _ = writeln!(text, "Medians of {RUNS} runs, ticks of {TICKS}; server and client share the cores.\n");
        text.push_str(
            "## Calls\n\n\
             The same question over gRPC and in process, on all cores. `Evaluate` is compared with a loop over the \
             library's distances, each with its warm start, without scene, names or threads that wait, and less the \
             transport of as many bytes. \
             `CheckStates` are 1 000 states of a Franka Emika Panda (links of degree 6) by their joint values, among the \
             boxes and cylinders of a planning problem: half of the states on the straight path of the joints, half anywhere.\n\n",
        );
        text += &block("scenes.csv", "calls", "");
        text.push_str(
            "\n## Ticks\n\n\
             Bricks of degree 6 stand side by side with gaps of 2.5 to 6.5 cm. A tenth of them moves by up to 1 cm along \
             each axis, and everything within 5 cm of those is asked for. Beside it the time to measure just the pairs \
             that were found, after the same moves, with warm starts of the tick before.\n\n",
        );
        text += &block("scenes.csv", "ticks", "");
        text.push_str("\n## Poses at rate, forks, ladders\n\n");
        text += &block("scenes.csv", "others", "");
        text
    }

    /// Three tables, an empty line between them.
    pub fn csv(&self) -> String {
        let mut text = String::from("method,about,items,free,call_us,inside_us,transport_us\n");
        for Call { method, about, items, free, call_us, inside_us, transport_us } in &self.calls {
            let free = free.map(|free| free.to_string()).unwrap_or_default();
            let _ = writeln!(text, "{method},\"{about}\",{items},{free},{call_us},{inside_us},{transport_us}");
        }
        text.push_str("\nobjects,moved,pairs,tick_ms,update_ms,solve_ms\n");
        for Tick { objects, moved, pairs, tick_ms, update_ms, solve_ms } in &self.ticks {
            let _ = writeln!(text, "{objects},{moved},{pairs},{tick_ms},{update_ms},{solve_ms}");
        }
        let (ages, clutter) = (&self.ages, &self.clutter);
        let _ = write!(
            text,
            "\ncapacity_per_s,asked_per_s,sent_per_s,median_ms,p99_ms,fork_us,free,finest_ms,ladder_ms\n\
             {},{},{},{},{},{},{},{},{}\n",
            ages.capacity_per_s,
            ages.asked_per_s,
            ages.sent_per_s,
            ages.median_ms,
            ages.p99_ms,
            self.fork_us,
            clutter.free,
            clutter.finest_ms,
            clutter.ladder_ms
        );
        text
    }
}
