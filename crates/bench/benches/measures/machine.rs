//! What the figures were measured on and with.

use serde::Serialize;
use std::fs;
use sublevel_bench::{self as bench, comparison::parry_version};

/// The machine and the versions, as far as they can be known.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
    #[serde(flatten)]
    this: bench::Machine,
    parry: String,
    coal: Option<String>,
    /// Load average of the last minute, before and after.
    load: [Option<f64>; 2],
}

impl Machine {
    pub(crate) fn new(coal: Option<String>) -> Self {
        Self { this: bench::Machine::this(), parry: parry_version(), coal, load: [load(), None] }
    }

    /// Notes the load once all is measured.
    pub(crate) fn end(&mut self) {
        self.load[1] = load();
    }

    /// What else ran meanwhile: with more at work than there are cores, times are not to be
    /// trusted.
    pub(crate) fn print_load(&self) {
        if let [Some(before), Some(after)] = self.load {
            println!("load     {before} before, {after} after, on {} cores", self.this.cores);
            // The bench itself is one.
            if before.max(after) > 1.5 {
                println!("         the machine was busy: repeat this on a quiet one before quoting it");
            }
        }
    }

    /// Two comments for the head of a CSV: command and machine, peers and load.
    pub(crate) fn comments(&self, quick: bool) -> String {
        let flags = if quick { "--quick --csv FILE" } else { "--csv FILE" };
        let command = format!("cargo bench -p sublevel-bench --bench measures -- {flags}");
        let load = self.load.map(|load| load.map_or("unknown".to_owned(), |load| load.to_string()));
        format!(
            "# {}\n# Peers: coal {}, parry3d-f64 {}. Load average of the machine: {} before, {} after.\n",
            self.this.head(&command),
            self.coal.as_deref().unwrap_or("absent"),
            self.parry,
            load[0],
            load[1]
        )
    }

    pub(crate) fn print(&self) {
        let bench::Machine { cpu, cores, simd, commit, rustc, date } = &self.this;
        println!("machine  {cpu}, {cores} cores, {simd}");
        println!("commit   {commit}, {rustc}, on {date}");
        println!("peers    coal {}, parry3d-f64 {}", self.coal.as_deref().unwrap_or("absent"), self.parry);
    }
}

fn load() -> Option<f64> {
    fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}
