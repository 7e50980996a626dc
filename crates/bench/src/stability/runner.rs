//! Cases in processes of their own: what hangs is stopped, what crashes takes nothing with it.

use super::families::{FAMILIES, Family};
use super::method::Method;
use super::question::{CaseError, Verdict};
use serde::{Deserialize, Serialize};
use std::io::{BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

/// Longest time of a case, the making of its bodies included.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);

/// Hangs and crashes of a cell before the rest of its cases is left out.
const MOST_LOST: usize = 3;

/// What came of the cases of one family with one method.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    pub(super) method: Method,
    /// Cases that were put.
    pub(super) cases: u64,
    /// Cases that were not put any more after hangs and crashes.
    pub(super) left_out: u64,
    /// The failures, by their seeds.
    pub(super) failures: Vec<(u64, Verdict)>,
}

/// What a child prints of a case.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    seed: u64,
    /// None where the method cannot be asked.
    verdict: Option<Verdict>,
}

/// Which cases a child is for: all of one family with one method from a seed on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// Number of the family.
    pub family: u8,
    /// The column.
    pub method: Method,
    /// The first seed.
    pub from: u64,
    /// One past the last seed.
    pub to: u64,
}

/// No family, method or seed of that name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0} is not FAMILY/METHOD/SEED, such as 13/cold/5; families: 1 to 16, 18 to 22, 25 to 27, and 100 more between primitives; methods: {1}"
)]
pub struct NoShare(String, String);

impl std::str::FromStr for Share {
    type Err = NoShare;

    /// `FAMILY/METHOD/SEED`, or `FAMILY/METHOD/FROM-TO`.
    fn from_str(text: &str) -> Result<Self, NoShare> {
        let parse = || {
            let mut parts = text.split('/');
            let (family, method, seeds) = (parts.next()?.parse().ok()?, parts.next()?, parts.next()?);
            let known = FAMILIES.iter().any(|row| row.number() == family) && parts.next().is_none();
            let method = method.parse().ok().filter(|_| known)?;
            // Seeds of different families are a million apart.
            let within = |share: &Self| share.from < share.to && share.to <= 1_000_000;
            let (from, to) = match seeds.split_once('-') {
                Some((from, to)) => (from.parse().ok()?, to.parse().ok()?),
                None => (seeds.parse().ok()?, seeds.parse::<u64>().ok()?.checked_add(1)?),
            };
            Some(Self { family, method, from, to }).filter(within)
        };
        let names = || Method::ALL.map(Method::name).join(", ");
        parse().ok_or_else(|| NoShare(text.to_owned(), names()))
    }
}

/// Puts the cases of a share in this process, and writes a line for each as soon as it is judged:
/// of JSON, or for people.
///
/// # Errors
/// What stands in the way of writing.
pub fn serve(share: &Share, as_json: bool, out: &mut impl Write) -> std::io::Result<()> {
    for family in FAMILIES.iter().filter(|family| family.number() == share.family) {
        for seed in share.from..share.to {
            let verdict = match family.put(seed, share.method) {
                Ok(verdict) => verdict,
                Err(CaseError::Crashed(_)) => Some(Verdict::Crash),
                Err(error) => Some(Verdict::WrongStatus(format!("the case cannot be put: {error}"))),
            };
            if as_json {
                serde_json::to_writer(&mut *out, &Line { seed, verdict })?;
                writeln!(out)?;
            } else {
                let what = family.describe(seed);
                let outcome = verdict.as_ref().map_or("cannot be asked".to_owned(), Verdict::to_string);
                writeln!(
                    out,
                    "{} {}, seed {seed}, {}: {outcome}\n{what}",
                    family.number(),
                    family.name(),
                    share.method.title()
                )?;
            }
            out.flush()?;
        }
    }
    Ok(())
}

/// How a child ended.
enum End {
    Done,
    Hung,
    Crashed,
}

/// Puts so many cases of a family to a method; none if it cannot be asked.
pub(super) fn run(program: &Path, family: &Family, method: Method, count: u64) -> std::io::Result<Option<Cell>> {
    let mut cell = Cell { method, cases: 0, left_out: 0, failures: Vec::new() };
    let (mut next, mut lost, mut asked) = (0, 0, false);
    while next < count && lost < MOST_LOST {
        let share = format!("{}/{}/{next}-{count}", family.number(), method.name());
        let end = child(program, &share, |line| {
            next = line.seed + 1;
            if let Some(verdict) = line.verdict {
                asked = true;
                cell.cases += 1;
                if verdict != Verdict::Pass {
                    cell.failures.push((line.seed, verdict));
                }
            }
        })?;
        let verdict = match end {
            End::Done if next >= count => break,
            End::Hung => Verdict::Hang,
            End::Done | End::Crashed => Verdict::Crash,
        };
        asked = true;
        cell.cases += 1;
        cell.failures.push((next, verdict));
        (next, lost) = (next + 1, lost + 1);
    }
    cell.left_out = count.saturating_sub(next);
    Ok(asked.then_some(cell))
}

/// Starts a child and passes on each of its lines.
fn child(program: &Path, share: &str, mut on_line: impl FnMut(Line)) -> std::io::Result<End> {
    let mut child = Command::new(program)
        .args(["stability", "--replay", share, "--json"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .process_group(0)
        .spawn()?;
    let Some(output) = child.stdout.take() else { return Ok(End::Crashed) };
    let (send, lines) = channel();
    let reader = thread::spawn(move || {
        for line in BufReader::new(output).lines().map_while(Result::ok) {
            if send.send(line).is_err() {
                break;
            }
        }
    });
    let end = loop {
        match lines.recv_timeout(PATIENCE) {
            Ok(line) => match serde_json::from_str(&line).map(&mut on_line) {
                Ok(()) => {}
                Err(_) => break End::Crashed,
            },
            Err(RecvTimeoutError::Timeout) => break End::Hung,
            Err(RecvTimeoutError::Disconnected) => {
                break if child.wait()?.success() { End::Done } else { End::Crashed };
            }
        }
    };
    if child.try_wait()?.is_none() {
        // With whatever it waits for.
        let group = format!("-{}", child.id());
        let _ = Command::new("kill").args(["-KILL", "--", &group]).stderr(Stdio::null()).status();
        let _ = child.kill();
        child.wait()?;
    }
    let _ = reader.join();
    Ok(end)
}
