//! Speed against accuracy: every representation of pairs of objects by how wrong it is and how long
//! a query takes.

mod cover;
mod effort;
mod front;
mod meshes;
mod ours;
mod outer;
mod peers;
mod pictures;
mod race;
mod report;
mod round;
mod shown;

use super::Machine;
use super::comparison::{Coal, ComparisonError, FitCache, pairs};
use effort::Effort;
use race::{About, Race, race};
pub(crate) use shown::Shown;
use std::ops::ControlFlow;
use std::path::Path;

/// All pairs, measured.
pub struct Speed {
    machine: Machine,
    /// Version of coal, if it ran.
    coal: Option<String>,
    quick: bool,
    passes: usize,
    races: Vec<(Race, About)>,
}

/// Measures all pairs of the meshes in `data`, or two of them with fewer representations and poses
/// if `quick`. Fits are kept in the `cache`; coal takes part where `SUBLEVEL_COAL` names the
/// program that times it. `progress` receives what is going on and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn speed(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Speed, ComparisonError> {
    let effort = if quick {
        Effort { quick, trajectories: 2, poses: 100, passes: 3, slow_poses: 2, slow_passes: 1 }
    } else {
        Effort { quick, trajectories: 4, poses: 400, passes: 5, slow_poses: 8, slow_passes: 2 }
    };
    let coal = Coal::from_environment()?;
    let mut announce = |at: &str| if progress(at).is_break() { Err(ComparisonError::Cancelled) } else { Ok(()) };
    // A mesh that is missing is reported before any work.
    let pairs = pairs(data, quick)?;
    let races = pairs.iter().map(|[a, b]| race([a, b], &effort, cache, coal.as_ref(), &mut announce));
    let races = races.collect::<Result<Vec<_>, _>>()?;
    let coal = coal.as_ref().map(Coal::version);
    Ok(Speed { machine: Machine::this(), coal, quick, passes: effort.passes, races })
}
