//! The CSV, and what is rescued by name.

use super::Ablation;
use super::counted::Table;
use super::library::Stage;
use std::fmt::Write;

impl Ablation {
    /// A row for each kind of queries and stage, and one for all stages together; first how it was
    /// made.
    pub fn csv(&self) -> String {
        let command = format!(
            "cargo run --release -p sublevel-bench --features ablation -- ablation --queries {:e}",
            self.queries
        );
        let mut text = format!("# {}\n", self.machine.head(&command));
        text += "set,stage,queries,unsure,rescued,wrong,iterations,iterations_without,worst,worst_without,time\n";
        for (set, table) in &self.tables {
            let Table { queries, unsure, iterations, worst, .. } = table;
            let mean = *iterations as f64 / (*queries).max(1) as f64;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{set},all,{queries},{unsure},,,{mean:.3},,{worst},,");
            for stage in Stage::ALL {
                let row = table.row(stage);
                let [with, without] = row.iterations.map(|sum| sum as f64 / row.asked.max(1) as f64);
                let _ = writeln!(
                    text,
                    "{set},{stage:?},{},,{},{},{with:.3},{without:.3},{},{},{:.3}",
                    row.asked,
                    row.rescued,
                    row.wrong,
                    row.worst[0],
                    row.worst[1],
                    table.ratio(stage)
                );
            }
        }
        text
    }

    /// The first queries that each stage rescues, and all that are wrong without it, a line each.
    pub fn named(&self) -> String {
        let mut text = String::new();
        for (set, table) in &self.tables {
            for (stage, row) in &table.rows {
                for first in &row.first {
                    let _ = writeln!(text, "{set}, {stage:?}: {first}");
                }
            }
        }
        text
    }

    /// Brackets that do not meet those without some stage.
    pub fn wrong(&self) -> u64 {
        self.tables.iter().flat_map(|(_, table)| table.rows.values()).map(|row| row.wrong).sum()
    }
}
