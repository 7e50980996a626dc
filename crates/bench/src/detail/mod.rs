//! Detail: what each rung of the ladder buys in accuracy, what it costs, and how many questions it
//! settles; and how closely convex parts follow an object.

mod effort;
mod parts;
mod parts_report;
mod questions;
mod report;
mod rungs;
mod shown;

use super::Machine;
use super::comparison::{ComparisonError, FitCache, pairs};
use effort::Effort;
use parts::{Divided, parts};
pub(crate) use parts_report::Shown as PartsShown;
use rungs::{Ladder, ladder};
pub(crate) use shown::Shown;
use std::ops::ControlFlow;
use std::path::Path;

/// The ladders of all pairs and the parts of objects, measured.
pub struct Detail {
    machine: Machine,
    quick: bool,
    questions: usize,
    ladders: Vec<Ladder>,
    /// Convex decompositions.
    divided: Vec<Divided>,
}

/// Measures the rungs of pairs of the meshes in `data`, of two pairs up to degree 6 if `quick`.
/// Fits are kept in the `cache`. `progress` receives what is going on and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn detail(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Detail, ComparisonError> {
    let effort = if quick {
        Effort { quick, trajectories: 2, poses: 100, passes: 3, questions: 100 }
    } else {
        Effort { quick, trajectories: 4, poses: 400, passes: 5, questions: 2000 }
    };
    let mut announce = |at: &str| if progress(at).is_break() { Err(ComparisonError::Cancelled) } else { Ok(()) };
    let pairs = pairs(data, quick)?;
    let ladders = pairs.iter().map(|[a, b]| ladder([a, b], &effort, cache, &mut announce)).collect::<Result<_, _>>()?;
    let divided = parts(data, quick, &mut announce)?;
    Ok(Detail { machine: Machine::this(), quick, questions: effort.questions, ladders, divided })
}
