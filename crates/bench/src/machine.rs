//! What figures were measured on and with, for the head of a report.

use serde::Serialize;
use std::fs;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};
use sublevel::polynomial::widest;

/// The machine and the versions, as far as they can be known.
#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Name of the processor.
    pub cpu: String,
    /// Cores that can be used at once.
    pub cores: usize,
    /// What [`widest`] says.
    pub simd: &'static str,
    /// The sources: what `git describe` says of them, while they are where this was built.
    pub commit: String,
    /// The compiler that is installed now.
    pub rustc: String,
    /// Today in UTC, as year-month-day.
    pub date: String,
}

impl Machine {
    /// This one.
    pub fn this() -> Self {
        Self {
            cpu: cpu(),
            cores: std::thread::available_parallelism().map_or(0, usize::from),
            simd: widest(),
            commit: printed_by("git", &["describe", "--always", "--dirty", "--tags"]),
            rustc: printed_by("rustc", &["--version"]),
            date: date(SystemTime::now()),
        }
    }

    /// The first line of a report of a figure that one core makes: the command, and where this was.
    pub fn head(&self, command: &str) -> String {
        self.head_with(command, "of which one is used")
    }

    /// The same where cores are used otherwise.
    pub(super) fn head_with(&self, command: &str, used: &str) -> String {
        let Self { cpu, cores, simd, commit, rustc, date } = self;
        format!("Made by `{command}` on {date} on {cpu}, {cores} cores, {simd}, {used}; commit {commit}; {rustc}.")
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

/// The version of a package that is built in.
pub(super) fn locked(package: &str) -> String {
    let mut lines = include_str!("../../../Cargo.lock").lines();
    let name = format!("name = \"{package}\"");
    let version = lines.find(|line| *line == name).and_then(|_| lines.next());
    version.and_then(|line| line.split('"').nth(1)).unwrap_or("unknown").to_owned()
}

/// First line a program prints, or "unknown".
fn printed_by(program: &str, arguments: &[&str]) -> String {
    let output = Command::new(program).args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
    let line = output.ok().filter(|output| output.status.success()).and_then(|output| {
        let text = String::from_utf8(output.stdout).ok()?;
        text.lines().next().map(str::to_owned)
    });
    line.unwrap_or_else(|| "unknown".to_owned())
}

/// Year, month and day of a time in UTC, by the Gregorian calendar.
fn date(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    let mut day = seconds / 86_400;
    let mut year = 1970;
    let leap = |year: u64| year.is_multiple_of(4) && !year.is_multiple_of(100) || year.is_multiple_of(400);
    while day >= 365 + u64::from(leap(year)) {
        day -= 365 + u64::from(leap(year));
        year += 1;
    }
    let february = 28 + u64::from(leap(year));
    let mut month = 1;
    for days in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if day < days {
            break;
        }
        day -= days;
        month += 1;
    }
    format!("{year}-{month:02}-{:02}", day + 1)
}

#[cfg(test)]
mod tests {
    use super::date;
    use std::time::{Duration, UNIX_EPOCH};

    #[test]
    fn days_are_those_of_the_calendar() {
        for (seconds, day) in [
            (0, "1970-01-01"),
            (951_782_399, "2000-02-28"),
            (951_782_400, "2000-02-29"),
            (1_735_689_599, "2024-12-31"),
            (1_735_689_600, "2025-01-01"),
            (4_107_542_400, "2100-03-01"),
        ] {
            assert_eq!(date(UNIX_EPOCH + Duration::from_secs(seconds)), day);
        }
    }
}
