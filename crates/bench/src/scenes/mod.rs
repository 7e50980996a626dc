//! Scenes and questions: what the service adds to the library, and how scenes grow.

mod bricks;
mod calls;
mod clutter;
mod poses_at_rate;
mod report;
mod shown;
mod ticks;

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

use sublevel::scene::Crew;

use super::Machine;
use super::comparison::FitCache;
use super::panda::{Arm, Representation, families, read_problems};
use bricks::{seconds, stacked};
use calls::Call;
use clutter::Clutter;
use poses_at_rate::Ages;
pub(crate) use shown::Shown;
use ticks::Tick;

/// What was measured.
pub struct Scenes {
    machine: Machine,
    quick: bool,
    calls: Vec<Call>,
    ticks: Vec<Tick>,
    ages: Ages,
    fork_us: f64,
    clutter: Clutter,
}

/// Measures calls to a server on loopback in this process, ticks of scenes of up to 100 000
/// objects, forks, streamed poses, and ladders. The robot and its problems are those of `data`;
/// fits are kept in the `cache`. `progress` receives what is going on and can stop it.
///
/// # Errors
/// Data that is missing, fits that fail, and a server that fails.
pub fn scenes(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Scenes, Box<dyn Error>> {
    let mut announce = |at: &str| if progress(at).is_break() { Err("stopped") } else { Ok(()) };
    let machine = Machine::this();
    let crew = Crew::new(machine.cores)?;
    announce("pairs of one message")?;
    let mut calls = vec![calls::evaluate(&crew)?];
    announce("states of a robot")?;
    let arm = Arm::read(data)?;
    let loaded = arm.load(Representation::Degree6, cache)?;
    let problems = read_problems(&data.join("panda/panda_problems.json"))?;
    let first: Vec<_> = families(&problems, 1).concat();
    let first = first.get(..if quick { 2 } else { first.len() }).unwrap_or(&first);
    calls.extend(calls::check_states((&arm, &loaded), first, &crew)?);
    let sizes: &[usize] =
        if quick { &[1000, 3000, 10_000] } else { &[1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000] };
    let mut measured = Vec::new();
    for &objects in sizes {
        announce(&format!("a tick of {objects} objects"))?;
        measured.push(ticks::tick(objects, &crew)?);
    }
    announce("poses at 1 kHz")?;
    let ages = poses_at_rate::ages(if quick { 2.0 } else { 10.0 })?;
    announce("forks")?;
    let scene = stacked(5, 10_000)?;
    let fork_us = 1e6 * seconds(|| scene.fork("fork").map(drop).map_err(Into::into))?;
    announce("ladders")?;
    let clutter = clutter::clutter(&crew)?;
    Ok(Scenes { machine, quick, calls, ticks: measured, ages, fork_us, clutter })
}
