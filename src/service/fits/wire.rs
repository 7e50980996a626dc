//! Between messages and fits that are jobs.

use super::super::proto::{self, BodyKind, FitPhase, FitProgress, FitResult, FitTask};
use super::super::wire::count;
use super::request::{options, read_solver, solver_message};
use crate::body::SolverStep;
use crate::jobs::{Phase, Progress};
use crate::store::{FitOptimum, FitOutcome, FitTask as Fit, FittedBody, FittedKind};

/// What a job can make.
const KINDS: [(FittedKind, BodyKind); 3] = [
    (FittedKind::Body, BodyKind::Body),
    (FittedKind::Compound, BodyKind::Compound),
    (FittedKind::SosBody, BodyKind::SosBody),
];

/// A fit as it stands; `progress` is of running ones only.
pub(in crate::service) fn task(
    Fit { request, points }: &Fit,
    progress: Option<Progress>,
    outcome: Option<&FitOutcome>,
) -> FitTask {
    FitTask {
        name: request.name.clone(),
        input: request.input.clone(),
        options: Some(options(request)),
        point_count: *points as u64,
        progress: progress.map(progress_message),
        result: outcome.map(result),
    }
}

fn progress_message(progress: Progress) -> FitProgress {
    let phase = match progress.phase {
        Phase::Preparing => FitPhase::Preparing,
        Phase::Trimming => FitPhase::Trimming,
        Phase::Solving => FitPhase::Fitting,
    };
    FitProgress {
        phase: phase.into(),
        rounds: progress.rounds,
        iterations: progress.iterations,
        gap: progress.gap,
        active_points: progress.active_points as u64,
    }
}

/// How far a fit of a message is.
pub(in crate::service) fn progress(message: &FitProgress) -> Progress {
    let phase = match message.phase() {
        FitPhase::Preparing | FitPhase::Unspecified => Phase::Preparing,
        FitPhase::Trimming => Phase::Trimming,
        FitPhase::Fitting => Phase::Solving,
    };
    Progress {
        phase,
        rounds: message.rounds,
        iterations: message.iterations,
        gap: message.gap,
        active_points: usize::try_from(message.active_points).unwrap_or(usize::MAX),
    }
}

fn result(outcome: &FitOutcome) -> FitResult {
    FitResult {
        bodies: outcome.bodies.iter().map(fitted).collect(),
        left_out_count: outcome.left_out as u64,
        left_out_m: outcome.left_out_m,
        ladder_id: outcome.ladder.clone().unwrap_or_default(),
    }
}

fn fitted(made: &FittedBody) -> proto::FittedBody {
    let kind = KINDS.iter().find(|(kind, _)| *kind == made.kind);
    proto::FittedBody {
        body_id: made.id.clone(),
        gap_m: made.gap_m,
        mean_gap_m: made.mean_gap_m,
        duration_s: made.seconds,
        optimum: made.optimum.as_ref().map(|optimum| proto::FitOptimum {
            objective_value: optimum.objective_value,
            optimality_gap: optimum.optimality_gap,
            refinement_end: optimum.refinement_end.clone().unwrap_or_default(),
            solver: solver_message(optimum.solver).into(),
            fallback: optimum.fallback.clone().unwrap_or_default(),
            steps: optimum.log.iter().map(step_message).collect(),
        }),
        kind: kind.map_or(BodyKind::Unspecified, |(_, kind)| *kind).into(),
        members: made.members.iter().map(|&member| count(member)).collect(),
    }
}

fn step_message(step: &SolverStep) -> proto::SolverStep {
    let SolverStep { round, iteration, primal, dual, primal_residual, dual_residual, step_length } = *step;
    let (round, iteration) = (count(round), count(iteration));
    proto::SolverStep { round, iteration, primal, dual, primal_residual, dual_residual, step_length }
}

fn read_step(step: &proto::SolverStep) -> SolverStep {
    let number = |count: u32| usize::try_from(count).unwrap_or(usize::MAX);
    SolverStep {
        round: number(step.round),
        iteration: number(step.iteration),
        primal: step.primal,
        dual: step.dual,
        primal_residual: step.primal_residual,
        dual_residual: step.dual_residual,
        step_length: step.step_length,
    }
}

/// What a message says that a job made; none of a kind that this program does not know.
pub(crate) fn outcome(result: &FitResult) -> Option<FitOutcome> {
    let body = |made: &proto::FittedBody| {
        let (kind, _) = KINDS.iter().find(|(_, kind)| *kind == made.kind())?;
        Some(FittedBody {
            kind: *kind,
            id: made.body_id.clone(),
            gap_m: made.gap_m,
            mean_gap_m: made.mean_gap_m,
            seconds: made.duration_s,
            optimum: made.optimum.as_ref().map(|optimum| FitOptimum {
                objective_value: optimum.objective_value,
                optimality_gap: optimum.optimality_gap,
                refinement_end: Some(optimum.refinement_end.clone()).filter(|end| !end.is_empty()),
                // One that this program does not know is as good as none.
                solver: read_solver(optimum.solver, "").unwrap_or_default(),
                fallback: Some(optimum.fallback.clone()).filter(|why| !why.is_empty()),
                log: optimum.steps.iter().map(read_step).collect(),
            }),
            members: made.members.iter().map(|&member| usize::try_from(member).unwrap_or(usize::MAX)).collect(),
            shortfall: None,
        })
    };
    let bodies = result.bodies.iter().map(body).collect::<Option<_>>()?;
    let left_out = usize::try_from(result.left_out_count).unwrap_or(usize::MAX);
    let ladder = Some(result.ladder_id.clone()).filter(|id| !id.is_empty());
    Some(FitOutcome { bodies, ladder, left_out, left_out_m: result.left_out_m })
}
