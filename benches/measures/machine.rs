//! What the figures were measured on and with.

use serde::Serialize;
use std::fs;
use sublevel::chart;

/// The machine and the versions, as far as they can be told.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
    #[serde(flatten)]
    this: chart::Machine,
    parry: String,
    coal: Option<String>,
    /// Load average of the last minute, before and after.
    load: [Option<f64>; 2],
}

impl Machine {
    pub(crate) fn new(coal: Option<String>) -> Self {
        Self { this: chart::Machine::this(), parry: locked_version("parry3d-f64"), coal, load: [load(), None] }
    }

    /// Notes the load once all is measured.
    pub(crate) fn end(&mut self) {
        self.load[1] = load();
    }

    /// What else ran meanwhile: with more at work than there are cores, times are not to be trusted.
    pub(crate) fn print_load(&self) {
        if let [Some(before), Some(after)] = self.load {
            println!("load     {before} before, {after} after, on {} cores", self.this.cores);
            // The bench itself is one.
            if before.max(after) > 1.5 {
                println!("         the machine was busy: repeat this on a quiet one before quoting it");
            }
        }
    }

    pub(crate) fn print(&self) {
        let chart::Machine { cpu, cores, simd, commit, rustc } = &self.this;
        println!("machine  {cpu}, {cores} cores, {simd}");
        println!("commit   {commit}, {rustc}");
        println!("peers    coal {}, parry3d-f64 {}", self.coal.as_deref().unwrap_or("absent"), self.parry);
    }
}

fn load() -> Option<f64> {
    fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// Version of a dependency in the lock file.
fn locked_version(name: &str) -> String {
    let mut lines = include_str!("../../Cargo.lock").lines();
    let wanted = format!("name = \"{name}\"");
    let version = lines.find(|line| *line == wanted).and_then(|_| lines.next());
    version.and_then(|line| line.split('"').nth(1)).unwrap_or("unknown").to_owned()
}
