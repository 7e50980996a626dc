//! What processes have worked, and what memory they hold.

use std::fs;

/// Ticks of a second in /proc, the same on all Linux systems.
const TICKS_PER_S: f64 = 100.0;

/// Seconds of work of a process on all cores; of this one without an id. None where the system does
/// not say.
pub(super) fn cpu_s(pid: Option<u32>) -> Option<f64> {
    let who = pid.map_or_else(|| "self".to_owned(), |pid| pid.to_string());
    let stat = fs::read_to_string(format!("/proc/{who}/stat")).ok()?;
    // After the name, which may contain anything: user and system time are the 12th and 13th.
    let mut fields = stat.rsplit(')').next()?.split_whitespace().skip(11);
    let user: f64 = fields.next()?.parse().ok()?;
    let system: f64 = fields.next()?.parse().ok()?;
    Some((user + system) / TICKS_PER_S)
}

/// Memory of a process that is in use, MiB. None where the system does not say.
pub(super) fn memory_mib(pid: u32) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_is_seen() {
        let before = cpu_s(None).expect("this process");
        let begun = std::time::Instant::now();
        while begun.elapsed().as_secs_f64() < 0.2 {
            std::hint::spin_loop();
        }
        let worked = cpu_s(Some(std::process::id())).expect("the same") - before;
        assert!(worked > 0.02, "{worked}");
        assert!(cpu_s(Some(u32::MAX)).is_none());
    }

    #[test]
    fn memory_is_seen() {
        let before = memory_mib(std::process::id()).expect("this process");
        let held = std::hint::black_box(vec![1_u8; 64 << 20]);
        let now = memory_mib(std::process::id()).expect("this process");
        assert!(now > before + 32.0, "{before} {now} with {} bytes", held.len());
        assert!(memory_mib(u32::MAX).is_none());
    }
}
