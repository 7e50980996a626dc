//! The long run: billions of bracketed queries, each answer checked, some against 200 bits and some
//! against semidefinite programs. Seeded, resumable, replayable.
//!
//! ```text
//! cargo bench -p sublevel-bench --bench endurance -- --queries 1e9 --threads 2 \
//!     --state run.json --seed 1 --summary docs/endurance.md
//! # Replay one block and report its failures:
//! cargo bench -p sublevel-bench --bench endurance -- --seed 1 --block 4711
//! # Pairs of the body files in a folder:
//! cargo bench -p sublevel-bench --bench endurance -- --queries 1e7 --bodies bodies
//! ```
//!
//! An OpenBLAS of several threads gives the programs other last digits from run to run unless
//! `OPENBLAS_NUM_THREADS=1`.

#[path = "../../../fit/tests/level_zero.rs"]
mod sos;

mod block;
mod catalogue;
mod companion;
mod draw;
mod measures;
mod state;
mod summary;
mod tally;
mod verdict;

use clap::Parser;
use state::State;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use sublevel::body::Body;
use sublevel::measure::{Options, Pose, WarmStart, distance};
use sublevel_bench::enter_workspace;
use sublevel_testkit::random::{pose, shifted, turned};

/// Blocks of a whole run that hold an answer against a semidefinite program, if there is one: a
/// fifth of them draw a growth distance, or sizes too far apart for it, and 1 000 are to be left.
const PROGRAMS: u64 = 1300;

/// Time between two writings of the state.
const BETWEEN: Duration = Duration::from_secs(5);

#[derive(Parser)]
struct Arguments {
    /// Bracketed solves of the whole run, such as 1e9.
    #[arg(long, default_value = "1e5")]
    queries: f64,
    #[arg(long, default_value_t = 1)]
    threads: usize,
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// File to continue from and to keep the state in.
    #[arg(long)]
    state: Option<PathBuf>,
    /// File for the summary.
    #[arg(long)]
    summary: Option<PathBuf>,
    /// Folder of body files to draw from in place of the catalogue.
    #[arg(long)]
    bodies: Option<PathBuf>,
    /// Replay only this block and tell its failures and its slow solves.
    #[arg(long)]
    block: Option<u64>,
    /// What cargo says to every bench.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() {
    let arguments = Arguments::parse();
    if arguments.bench {
        enter_workspace().expect("the workspace is where it was compiled");
    }
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("endurance");
    let bodies = match &arguments.bodies {
        Some(folder) => catalogue::read(folder),
        None => catalogue::catalogue(&folder),
    };
    assert!(!bodies.is_empty(), "no body files (.json) in {}", arguments.bodies.unwrap_or(folder).display());
    let blocks = (arguments.queries / block::SOLVES as f64).ceil() as u64;
    let every = (blocks / PROGRAMS).max(1);
    if let Some(number) = arguments.block {
        let tally = block::run(&bodies, arguments.seed, number, true);
        for failure in &tally.kept {
            println!("query {}: {}: {}", failure.query, failure.check.name(), failure.detail);
        }
        for (iterations, query, detail) in &tally.slow {
            println!("query {query}: {iterations} iterations: {detail}");
        }
        println!("{} solves, {} failures", tally.solves, tally.failed());
        return;
    }

    let state = begin(&arguments, &bodies);
    let (before, seconds) = (state.blocks(), state.seconds);
    let next = AtomicU64::new(state.next);
    let finished = AtomicBool::new(false);
    let shared = Mutex::new(state);
    let start = Instant::now();
    let keep = |state: &mut State| {
        state.seconds = seconds + start.elapsed().as_secs_f64();
        if let Some(path) = &arguments.state {
            state.write(path);
        }
    };
    std::thread::scope(|scope| {
        let workers: Vec<_> = (0..arguments.threads.max(1))
            .map(|_| {
                scope.spawn(|| {
                    loop {
                        let number = next.fetch_add(1, Ordering::Relaxed);
                        if number >= blocks {
                            break;
                        }
                        if shared.lock().expect("no thread panicked").has(number) {
                            continue;
                        }
                        let tally = block::run(&bodies, arguments.seed, number, number.is_multiple_of(every));
                        shared.lock().expect("no thread panicked").done(number, tally);
                    }
                })
            })
            .collect();
        scope.spawn(|| {
            let mut written = Instant::now();
            while !finished.load(Ordering::Relaxed) {
                std::thread::sleep(Duration::from_millis(50));
                if written.elapsed() >= BETWEEN {
                    written = Instant::now();
                    let mut state = shared.lock().expect("no thread panicked");
                    keep(&mut state);
                    progress(&state, blocks, before, start.elapsed());
                }
            }
        });
        for worker in workers {
            let ended = worker.join();
            if ended.is_err() {
                finished.store(true, Ordering::Relaxed);
            }
            ended.expect("a block ran through");
        }
        finished.store(true, Ordering::Relaxed);
    });
    let mut state = shared.into_inner().expect("no thread panicked");
    keep(&mut state);
    progress(&state, blocks, before, start.elapsed());
    let text = summary::markdown(&state, arguments.bodies.is_some(), arguments.threads);
    println!("{text}");
    if let Some(path) = &arguments.summary {
        state::write(path, &text);
    }
    for failure in state.tally.kept.iter().take(10) {
        println!("block {} query {}: {}: {}", failure.block, failure.query, failure.check.name(), failure.detail);
    }
    if state.tally.failed() > 0 {
        std::process::exit(1);
    }
}

/// A state to continue, or a new one.
fn begin(arguments: &Arguments, bodies: &[Body]) -> State {
    let hash = ids(bodies);
    let old = arguments.state.as_deref().and_then(State::read);
    let mut state = old.unwrap_or_else(|| State { seed: arguments.seed, bodies: hash.clone(), ..State::default() });
    assert!(state.seed == arguments.seed, "the state is of seed {}, not {}", state.seed, arguments.seed);
    assert!(state.bodies == hash, "the state is of other bodies; its queries cannot be continued");
    let git = std::process::Command::new("git").args(["describe", "--always", "--dirty"]).output();
    let commit = git.ok().and_then(|output| String::from_utf8(output.stdout).ok()).unwrap_or_default();
    state.commits.insert(if commit.is_empty() { "unknown".into() } else { commit.trim().into() });
    state
}

/// What the catalogue is: the number of its bodies and a sum over their ids.
fn ids(bodies: &[Body]) -> String {
    let mut sum = 0_u64;
    for byte in bodies.iter().flat_map(|body| body.id().to_string().into_bytes()) {
        sum = (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    format!("{} bodies, {sum:016x}", bodies.len())
}

fn progress(state: &State, blocks: u64, before: u64, elapsed: Duration) {
    let (done, here) = (state.blocks(), state.blocks() - before);
    let rate = (here * block::SOLVES) as f64 / elapsed.as_secs_f64().max(1e-9);
    let left = blocks.saturating_sub(done) as f64 * block::SOLVES as f64 / rate.max(1e-9);
    let left = if here == 0 { 0 } else { left as u64 };
    let clock = format!("{}:{:02}:{:02}", left / 3600, left / 60 % 60, left % 60);
    let share = 100.0 * done as f64 / blocks.max(1) as f64;
    let failed = state.tally.failed();
    eprintln!("block {done}/{blocks} {share:.2} %  {rate:.0} solves/s  {clock} left  {failed} failures");
}
