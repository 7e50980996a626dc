//! What the figures were measured on and with.

use serde::Serialize;
use std::fs;
use std::process::Command;

/// The machine and the versions, as far as they can be told.
#[derive(Debug, Serialize)]
pub(crate) struct Machine {
    cpu: String,
    cores: usize,
    simd: &'static str,
    commit: String,
    rustc: String,
    parry: String,
    coal: Option<String>,
    /// Load average of the last minute, before and after.
    load: [Option<f64>; 2],
}

impl Machine {
    pub(crate) fn new(coal: Option<String>) -> Self {
        Self {
            cpu: cpu(),
            cores: std::thread::available_parallelism().map_or(0, usize::from),
            simd: simd(),
            commit: said("git", &["describe", "--always", "--dirty", "--tags"]),
            rustc: said("rustc", &["--version"]),
            parry: locked_version("parry3d-f64"),
            coal,
            load: [load(), None],
        }
    }

    /// Notes the load once all is measured.
    pub(crate) fn end(&mut self) {
        self.load[1] = load();
    }

    /// What else ran meanwhile: with more at work than there are cores, times are not to be trusted.
    pub(crate) fn print_load(&self) {
        if let [Some(before), Some(after)] = self.load {
            println!("load     {before} before, {after} after, on {} cores", self.cores);
            // The bench itself is one.
            if before.max(after) > 1.5 {
                println!("         the machine was busy: repeat this on a quiet one before quoting it");
            }
        }
    }

    pub(crate) fn print(&self) {
        println!("machine  {}, {} cores, {}", self.cpu, self.cores, self.simd);
        println!("commit   {}, {}", self.commit, self.rustc);
        println!("peers    coal {}, parry3d-f64 {}", self.coal.as_deref().unwrap_or("absent"), self.parry);
    }
}

fn cpu() -> String {
    let info = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |key: &str| {
        let line = info.lines().find(|line| line.split(':').next().is_some_and(|name| name.trim() == key))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    match (field("model name"), field("cpu family"), field("model")) {
        // Clouds hide the name; family and model still tell the generation.
        (Some(name), Some(family), Some(model)) => format!("{name} (family {family}, model {model})"),
        (Some(name), ..) => name,
        _ => std::env::consts::ARCH.to_owned(),
    }
}

/// The widest vectors of this machine, which the kernel chooses at run time.
/// The widest arithmetic of this processor.
pub(crate) fn simd() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f") {
            return "AVX-512";
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            return "AVX2";
        }
    }
    "baseline"
}

fn load() -> Option<f64> {
    fs::read_to_string("/proc/loadavg").ok()?.split_whitespace().next()?.parse().ok()
}

/// First line a program prints, or "unknown".
fn said(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let line = output.ok().filter(|output| output.status.success()).and_then(|output| {
        let text = String::from_utf8(output.stdout).ok()?;
        text.lines().next().map(str::to_owned)
    });
    line.unwrap_or_else(|| "unknown".to_owned())
}

/// Version of a dependency in the lock file.
fn locked_version(name: &str) -> String {
    let mut lines = include_str!("../../Cargo.lock").lines();
    let wanted = format!("name = \"{name}\"");
    let version = lines.find(|line| *line == wanted).and_then(|_| lines.next());
    version.and_then(|line| line.split('"').nth(1)).unwrap_or("unknown").to_owned()
}
