//! Pairs by type: every kind of shape against every other, beside the same shapes of other
//! libraries.

mod kind;
mod model;
mod race;
mod report;
mod shown;

use std::ops::ControlFlow;
use std::path::Path;

use super::Machine;
use super::comparison::{Coal, ComparisonError, FitCache, Subject, parry_version};
use kind::Kind;
use model::Model;
use race::{Effort, Time, race};
pub(crate) use shown::Shown;

/// The objects that shapes are made about: the first of a pair, and the second.
const SUBJECTS: [&str; 2] = ["chair", "human"];

/// What was measured.
pub struct Pairs {
    machine: Machine,
    /// Version of coal, if it ran.
    coal: Option<String>,
    parry: String,
    quick: bool,
    times: Vec<Time>,
}

/// Times every pair of kinds, or of five kinds at fewer poses if `quick`, about two meshes of
/// `data`. Fits are kept in the `cache`; coal takes part where `SUBLEVEL_COAL` names the program
/// that times it. `progress` receives what is going on and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn pairs(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Pairs, ComparisonError> {
    let (kinds, effort) = if quick {
        (&Kind::QUICK[..], Effort { trajectories: 1, poses: 64, turns: 1 })
    } else {
        (&Kind::ALL[..], Effort { trajectories: 4, poses: 256, turns: 5 })
    };
    let mut announce = |at: &str| if progress(at).is_break() { Err(ComparisonError::Cancelled) } else { Ok(()) };
    let coal = Coal::from_environment()?;
    let subjects = [Subject::read(SUBJECTS[0], data)?, Subject::read(SUBJECTS[1], data)?];
    let unit_m = 0.5 * subjects[0].diameter_m.max(subjects[1].diameter_m);
    let mut models = Vec::new();
    for &kind in kinds {
        announce(&format!("{}: shapes", kind.name()))?;
        models.push((kind, [Model::build(kind, &subjects[0], cache)?, Model::build(kind, &subjects[1], cache)?]));
    }
    let mut times = Vec::new();
    for (i, (kind_a, [a, _])) in models.iter().enumerate().filter(|(_, (kind_a, _))| kind_a.is_first()) {
        for (kind_b, [_, b]) in &models[i..] {
            announce(&format!("{} against {}", kind_a.name(), kind_b.name()))?;
            times.extend(race([*kind_a, *kind_b], [a, b], unit_m, &effort, (cache, coal.as_ref()))?);
        }
    }
    let coal = coal.as_ref().map(Coal::version);
    Ok(Pairs { machine: Machine::this(), coal, parry: parry_version(), quick, times })
}
