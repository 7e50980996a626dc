//! A server under load keeps its memory and its file descriptors. `SUBLEVEL_LONG=1800` loads it for
//! that many seconds.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::harness::Running;

/// Seconds of the quick run, and its calls a second: few, for other tests run beside it.
const QUICK: (u64, u32) = (6, 500);

/// Calls a second of longer runs of the mixed scenario: about half of what two cores answer that
/// the client uses, too.
const CALLS_PER_S: u32 = 4000;

/// Most memory that a server may gain from the second third of the time to the last, MiB: what the
/// allocator keeps changes by some. In half an hour that is 3 bytes a call.
const MOST_GAINED_MIB: i64 = 8;

/// Memory in use, MiB, and open file descriptors.
fn held(server: &Running) -> (i64, usize) {
    let process = Path::new("/proc").join(server.pid().to_string());
    let status = std::fs::read_to_string(process.join("status")).expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
    let kib: i64 = line.trim().trim_end_matches(" kB").parse().expect("a number");
    (kib / 1024, std::fs::read_dir(process.join("fd")).expect("its descriptors").count())
}

/// The most of both.
fn most(seen: &[(i64, usize)]) -> (i64, usize) {
    let (memory, open): (Vec<i64>, Vec<usize>) = seen.iter().copied().unzip();
    (memory.into_iter().max().expect("it was seen"), open.into_iter().max().expect("it was seen"))
}

#[test]
fn memory_and_descriptors_do_not_grow_under_load() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let asked = std::env::var("SUBLEVEL_LONG").ok().and_then(|seconds| seconds.parse().ok());
    let (seconds, rate) = asked.filter(|&seconds| seconds > QUICK.0).map_or(QUICK, |asked| (asked, CALLS_PER_S));
    let report = dir.path().join("load.json");
    let mut load = Command::new(env!("CARGO_BIN_EXE_sublevel"))
        .args(["load", "mixed", "--no-echo", "--warmup", "0", "--server", &server.url(), "--json"])
        .arg(&report)
        .args(["--rate", &rate.to_string(), "--duration", &seconds.to_string()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the load begins");
    let third = Duration::from_secs(seconds) / 3;
    let mut seen = Vec::new();
    let status = loop {
        if let Some(status) = load.try_wait().expect("it can be asked") {
            break status;
        }
        seen.push((Instant::now(), held(&server)));
        std::thread::sleep(third / 20);
    };
    // Counted back from its end: how long it prepares depends on what else the machine does.
    let end = Instant::now();
    let between = |from: u32, to: u32| {
        let at = |(when, _): &&(Instant, _)| (from * third..to * third).contains(&(end - *when));
        most(&seen.iter().filter(at).map(|(_, held)| *held).collect::<Vec<_>>())
    };
    let ((early_mib, early_open), (late_mib, late_open)) = (between(1, 2), between(0, 1));
    println!("{seconds} s at {rate}/s: {early_mib} to {late_mib} MiB, {early_open} to {late_open} descriptors");
    let report = std::fs::read_to_string(report).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("a report");
    let count = |field: &str| report["server"][0][field].as_f64().expect("a number");
    let (due, answered) = (count("offered_per_s"), count("answered_per_s"));
    assert!(status.success() && answered >= 0.5 * due && due > 0.0, "{status}, {answered} of {due} calls a second");
    assert!(late_mib - early_mib <= MOST_GAINED_MIB, "{seen:?}");
    assert!(late_open <= early_open + 1, "{seen:?}");
}
