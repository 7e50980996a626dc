//! Memory, as Linux tells it.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// How much copies of a thing take together to be told from noise, bytes.
const COPIES: f64 = 32e6;
/// At most so many of them.
const MOST_COPIES: usize = 20_000;
/// How often a process is looked at.
const LOOK: Duration = Duration::from_millis(1);

/// A field of a process's status, bytes.
fn status(process: &str, field: &str) -> Option<f64> {
    let text = fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(field)?.strip_prefix(':'))?;
    Some(1024.0 * line.trim().trim_end_matches(" kB").parse::<f64>().ok()?)
}

/// Bytes of a copy: the slope of resident memory over so many of them. `guess` is about what one takes.
pub(super) fn bytes_of<T: Clone>(thing: &T, guess: f64) -> Option<f64> {
    let count = ((COPIES / guess) as usize).clamp(100, MOST_COPIES);
    let mut kept = Vec::with_capacity(3 * count);
    // What the allocator had at hand is used up first.
    kept.extend(std::iter::repeat_n(thing, count).cloned());
    let before = status("self", "VmRSS")?;
    kept.extend(std::iter::repeat_n(thing, 2 * count).cloned());
    let after = status("self", "VmRSS")?;
    Some((after - before) / (2 * count) as f64)
}

/// The most memory that a process held, bytes, if it ends well.
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
        let thing = vec![1.0_f64; 4096];
        let bytes = bytes_of(&thing, 32e3).unwrap();
        assert!((30e3..36e3).contains(&bytes), "{bytes}");
    }

    #[test]
    fn peaks_are_seen_and_failures_told() {
        let found =
            peak(Path::new("sh"), &["-c", "x=$(head -c 20000000 /dev/zero | tr '\\0' a); sleep 0.1; test -n \"$x\""]);
        assert!(found.is_some_and(|bytes| bytes > 15e6), "{found:?}");
        assert_eq!(peak(Path::new("sh"), &["-c", "exit 1"]), None);
        assert_eq!(peak(Path::new("/nowhere/at/all"), &[]), None);
    }
}
