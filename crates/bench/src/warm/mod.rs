//! Warm starts: what a hint from the pose before is worth, by how far that pose is away; and the
//! paper's experiment.

mod effort;
mod report;
mod shown;
mod steps;
mod sweep;

use super::Machine;
use super::comparison::{Coal, ComparisonError, FitCache, pairs};
use effort::Effort;
pub(crate) use shown::Shown;
use std::ops::ControlFlow;
use std::path::Path;
use steps::{Steps, steps};
use sublevel::fit::FitOptions;
use sweep::{Passage, passage};

/// Degrees that are measured, and those of a quick run.
const DEGREES: [usize; 3] = [4, 6, 8];
const QUICK_DEGREES: [usize; 2] = [4, 6];
/// Sizes of steps, in units of half of the larger diameter; none for poses that have nothing to do
/// with each other.
const STEPS: [Option<f64>; 10] =
    [Some(1e-4), Some(3e-4), Some(1e-3), Some(3e-3), Some(1e-2), Some(3e-2), Some(0.1), Some(0.3), Some(1.0), None];
const QUICK_STEPS: [Option<f64>; 4] = [Some(1e-4), Some(1e-2), Some(0.3), None];

/// What hints are worth.
pub struct Warm {
    machine: Machine,
    /// Version of coal, if it ran.
    coal: Option<String>,
    quick: bool,
    passes: usize,
    /// Of each pair.
    steps: Vec<Steps>,
    passage: Passage,
}

/// Measures time and iterations against step size on two pairs of the meshes in `data`, or on one
/// if `quick`, and the chair on its way past the human. Fits are kept in the `cache`; coal takes
/// part where `SUBLEVEL_COAL` names the program that times it. `progress` receives what is going on
/// and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn warm(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Warm, ComparisonError> {
    let effort = if quick {
        Effort { trajectories: 2, poses: 100, passes: 3, positions: 61 }
    } else {
        Effort { trajectories: 4, poses: 400, passes: 5, positions: 201 }
    };
    let (degrees, sizes) = if quick { (&QUICK_DEGREES[..], &QUICK_STEPS[..]) } else { (&DEGREES[..], &STEPS[..]) };
    let coal = Coal::from_environment()?;
    let mut announce = |at: &str| if progress(at).is_break() { Err(ComparisonError::Cancelled) } else { Ok(()) };
    let mut pairs = pairs(data, true)?;
    if quick {
        pairs.truncate(1);
    }
    let mut measured = Vec::new();
    for [a, b] in &pairs {
        measured.push(steps([a, b], (degrees, sizes), &effort, (cache, coal.as_ref()), &mut announce)?);
    }
    announce("the chair passes the human")?;
    let [chair, human] = &pairs[0];
    let options = FitOptions { degree: 6, ..FitOptions::default() };
    let bodies = (cache.body(chair.name, &chair.mesh, &options)?, cache.body(human.name, &human.mesh, &options)?);
    let passage = passage((&bodies.0, &bodies.1), effort.positions, effort.passes)?;
    let coal = coal.as_ref().map(Coal::version);
    Ok(Warm { machine: Machine::this(), coal, quick, passes: effort.passes, steps: measured, passage })
}
