//! How far a fit has come, reported from inside its loops.

use super::FitError;
use std::ops::ControlFlow;
use sublevel_core::body::SolverStep;

/// How far a fit has come, after each iteration of its solver.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Programs begun: one per set of points or accuracy, and one per step of a refinement.
    pub round: usize,
    /// Interior-point iterations of all of them.
    pub iterations: usize,
    /// Points that the program takes into account.
    pub active_points: usize,
    /// Largest p - 1 over the hull's vertices at the end of the program before, at least 0.
    pub worst_violation: f64,
    /// About the distance to the optimum of the program, in units of log dets, or of the volume in
    /// refinements; while slabs are cut, the gap, metres.
    pub gap: f64,
}

/// Keeps the counts, and asks the caller whether to continue.
pub(super) struct Watch<'a> {
    progress: Progress,
    log: Vec<SolverStep>,
    report: &'a mut dyn FnMut(Progress) -> ControlFlow<()>,
}

impl<'a> Watch<'a> {
    pub(super) fn new(report: &'a mut dyn FnMut(Progress) -> ControlFlow<()>) -> Self {
        Self { progress: Progress::default(), log: Vec::new(), report }
    }

    /// A program begins; the one before left its points outside by `worst_violation`.
    pub(super) fn round(&mut self, active_points: usize, worst_violation: f64) {
        let round = self.progress.round + 1;
        self.progress = Progress { round, active_points, worst_violation, ..self.progress };
    }

    /// An iteration begins, about `gap` from the optimum.
    ///
    /// # Errors
    /// [`FitError::Cancelled`] when the caller asks to stop.
    pub(super) fn iteration(&mut self, gap: f64) -> Result<(), FitError> {
        self.progress.iterations += 1;
        self.progress.gap = gap;
        if (self.report)(self.progress).is_break() { Err(FitError::Cancelled) } else { Ok(()) }
    }

    /// As [`Watch::iteration`], with a step of the conic solver, which is logged.
    pub(super) fn solver_step(&mut self, step: SolverStep, gap: f64) -> Result<(), FitError> {
        self.log.push(step);
        self.iteration(gap)
    }

    /// Nothing has happened: another fit of the process has the solver.
    ///
    /// # Errors
    /// [`FitError::Cancelled`] when the caller asks to stop.
    pub(super) fn waiting(&mut self) -> Result<(), FitError> {
        if (self.report)(self.progress).is_break() { Err(FitError::Cancelled) } else { Ok(()) }
    }

    /// The steps of the conic solver so far.
    pub(super) fn log(&self) -> &[SolverStep] {
        &self.log
    }

    /// The counts so far.
    pub(super) fn progress(&self) -> Progress {
        self.progress
    }
}
