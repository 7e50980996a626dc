//! Memory, as Linux reports it.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// How much a round of copies takes about, bytes, if a copy takes so much.
const ROUND: f64 = 4e6;
const GUESS: f64 = 100e3;
/// Rounds at most; and so many on end must agree, to this part.
const ROUNDS: usize = 80;
const AGREEING: usize = 3;
const AGREEMENT: f64 = 0.05;
/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(1);

/// A field of a process's status, bytes.
fn status(process: &str, field: &str) -> Option<f64> {
    let text = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(field)?.strip_prefix(':'))?;
    Some(1024.0 * line.trim().trim_end_matches(" kB").parse::<f64>().ok()?)
}

/// Bytes of a copy of a thing, by resident memory: of a thing with so many `parts`, which guess how
/// many copies are needed. None where that cannot be known.
///
/// Freed memory that the allocator has at hand takes the first copies; once it is used up, rounds
/// of as many copies take as much each.
pub(super) fn bytes_of<T: Clone>(thing: &T, parts: usize) -> Option<f64> {
    let count = (ROUND / (GUESS * parts as f64)).ceil().max(8.0) as usize;
    let mut kept = Vec::with_capacity(ROUNDS);
    let mut grown: Vec<f64> = Vec::new();
    let mut before = status("self", "VmRSS")?;
    for _ in 0..ROUNDS {
        kept.push(vec![thing.clone(); count]);
        let now = status("self", "VmRSS")?;
        grown.push(now - before);
        before = now;
        let last = &grown[grown.len().saturating_sub(AGREEING)..];
        let (least, most) = last.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), v| (l.min(*v), m.max(*v)));
        if last.len() == AGREEING && least > 0.0 && most - least <= AGREEMENT * most {
            return Some(last.iter().sum::<f64>() / (AGREEING * count) as f64);
        }
    }
    None
}

/// The most memory that a process took, bytes, if it ends well.
pub(super) fn peak(program: &Path, arguments: &[&str]) -> Option<f64> {
    let quiet = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    let mut child = quiet.ok()?;
    let process = child.id().to_string();
    let mut most = None;
    loop {
        // The field is the most so far: only what happens after the last look is missed.
        most = status(&process, "VmHWM").or(most);
        if let Some(ended) = child.try_wait().ok()? {
            return most.filter(|_| ended.success());
        }
        std::thread::sleep(LOOK);
    }
}

#[cfg(test)]
mod tests {
    use super::{bytes_of, peak};
    use std::path::Path;

    #[test]
    fn copies_are_weighed() {
        let thing = vec![1.0_f64; 12_500];
        // A heap with holes.
        let holes: Vec<Vec<f64>> = (0..200).map(|_| thing.clone()).collect();
        drop(holes);
        let bytes = bytes_of(&thing, 1).unwrap();
        assert!((95e3..110e3).contains(&bytes), "{bytes}");
    }

    #[test]
    fn peaks_are_measured_and_failures_reported() {
        let found =
            peak(Path::new("sh"), &["-c", "x=$(head -c 20000000 /dev/zero | tr '\\0' a); sleep 0.1; test -n \"$x\""]);
        assert!(found.is_some_and(|bytes| bytes > 15e6), "{found:?}");
        assert_eq!(peak(Path::new("sh"), &["-c", "exit 1"]), None);
        assert_eq!(peak(Path::new("/nowhere/at/all"), &[]), None);
    }
}
