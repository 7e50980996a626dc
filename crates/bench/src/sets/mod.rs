//! Sets that need not be convex: brackets against time, by branch and bound and by the hierarchy;
//! and what a set that need not be convex buys beside compounds and convex bodies.

mod counterexample;
mod models;
mod pairs;
mod report;
mod shown;

use super::Machine;
use super::comparison::{ComparisonError, FitCache};
use counterexample::{Level, counterexample};
use models::{Model, models};
use pairs::{Bracket, brackets};
pub(crate) use shown::Shown;
use std::ops::ControlFlow;
use std::path::Path;

/// What was measured.
pub struct Sets {
    machine: Machine,
    quick: bool,
    brackets: Vec<Bracket>,
    counterexample: Vec<Level>,
    models: Vec<Model>,
}

/// Brackets the distances of random pairs of degree 4 and 6, and measures models of five objects in
/// `data` against these. Fits of bodies are kept in the `cache`. `progress` receives what is going
/// on and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn sets(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Sets, ComparisonError> {
    let mut announce = |at: &str| if progress(at).is_break() { Err(ComparisonError::Cancelled) } else { Ok(()) };
    let brackets = brackets(quick, &mut announce)?;
    announce("the counterexample")?;
    let counterexample = counterexample()?;
    let models = models(data, cache, quick, &mut announce)?;
    Ok(Sets { machine: Machine::this(), quick, brackets, counterexample, models })
}
