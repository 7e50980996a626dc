//! A server under load keeps its memory and its file descriptors. `SUBLEVEL_LONG=1800` loads it for
//! that many seconds.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use sublevel_testkit::random::draws;

use crate::harness::Running;

/// Calls a second of the mixed scenario: about half of what two cores answer that the client
/// uses, too.
const CALLS_PER_S: u64 = 4000;

/// Most memory that a server may gain after a third of the time, MiB: what the allocator keeps
/// changes by some. A hundred bytes a call that were never freed would be 23 MiB a minute.
const MOST_GAINED_MIB: i64 = 8;

/// Memory in use, MiB, and open file descriptors.
fn held(server: &Running) -> (i64, usize) {
    let process = Path::new("/proc").join(server.pid().to_string());
    let status = std::fs::read_to_string(process.join("status")).expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
    let kib: i64 = line.trim().trim_end_matches(" kB").parse().expect("a number");
    (kib / 1024, std::fs::read_dir(process.join("fd")).expect("its descriptors").count())
}

#[test]
fn memory_and_descriptors_do_not_grow_under_load() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let seconds = draws(6);
    let mut load = Command::new(env!("CARGO_BIN_EXE_sublevel"))
        .args(["load", "mixed", "--no-echo", "--warmup", "0", "--server", &server.url()])
        .args(["--rate", &CALLS_PER_S.to_string(), "--duration", &seconds.to_string()])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the load begins");
    let (start, third) = (Instant::now(), Duration::from_secs(seconds) / 3);
    let mut seen = Vec::new();
    while load.try_wait().expect("it can be asked").is_none() {
        if start.elapsed() > third && start.elapsed() < 3 * third {
            seen.push(held(&server));
        }
        std::thread::sleep(third / 20);
    }
    let report = load.wait_with_output().expect("its report");
    let report = String::from_utf8(report.stdout).expect("text");
    // The most of either half of that time: at its beginning a slow client may still prepare.
    let most = |of: &[(i64, usize)]| {
        let (memory, open): (Vec<i64>, Vec<usize>) = of.iter().copied().unzip();
        (memory.into_iter().max().expect("it was seen"), open.into_iter().max().expect("it was seen"))
    };
    let (early, late) = seen.split_at(seen.len() / 2);
    let ((early_mib, early_open), (late_mib, late_open)) = (most(early), most(late));
    println!("{seconds} s: {early_mib} to {late_mib} MiB, {early_open} to {late_open} descriptors");
    println!("{report}");
    assert!(late_mib - early_mib <= MOST_GAINED_MIB, "{seen:?}");
    assert!(late_open <= early_open + 1, "{seen:?}");
}
