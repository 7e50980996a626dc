//! Between the messages of FitService and jobs.

use super::super::error::Invalid;
use super::super::proto::{self, FitJob, FitPhase, FitProgress, FitResult, FitState};
use super::super::wire::count;
use super::request::options;
use crate::jobs::{Phase, Progress};
use crate::store::{FitOptimum, FitOutcome, FittedBody, FittedKind, Job, JobState};

/// What a job can make.
const KINDS: [(FittedKind, proto::FittedKind); 3] = [
    (FittedKind::Body, proto::FittedKind::Body),
    (FittedKind::Compound, proto::FittedKind::Compound),
    (FittedKind::SosBody, proto::FittedKind::SosBody),
];

pub(super) fn id(id: &str, field: &str) -> Result<u64, Invalid> {
    id.parse().map_err(|_| Invalid::new(field, "is no id of a fit job; give the one CreateFit returned"))
}

/// A job without the file that it made.
pub(super) fn job(job: &Job, progress: Option<Progress>) -> FitJob {
    let Job { id, request_id, request, points, attempts, state, .. } = job;
    let (state, failure, result) = match state {
        JobState::Queued => (FitState::Queued, "", None),
        JobState::Running => (FitState::Running, "", None),
        JobState::Succeeded(outcome) => (FitState::Succeeded, "", Some(result(outcome))),
        JobState::Failed(why) => (FitState::Failed, why.as_str(), None),
        JobState::Cancelled => (FitState::Cancelled, "", None),
    };
    FitJob {
        id: id.to_string(),
        name: request.name.clone(),
        request_id: request_id.clone(),
        input: request.input.clone(),
        options: Some(options(request)),
        point_count: *points as u64,
        state: state.into(),
        attempts: *attempts,
        failure: failure.to_owned(),
        // The worker may not have reported yet of the job it has begun, or of the one that was
        // cancelled.
        progress: (state == FitState::Running).then(|| progress_message(progress.unwrap_or_default())),
        result,
    }
}

/// Whether a job has made a file that [`job`] leaves out.
pub(super) fn has_file(job: &Job) -> bool {
    match &job.state {
        JobState::Succeeded(outcome) => outcome.bodies.iter().any(|made| made.kind != FittedKind::Body),
        _ => false,
    }
}

/// Adds the file to the message of a job that made one.
pub(super) fn with_file(mut job: FitJob, file: Vec<u8>) -> FitJob {
    if let Some(made) = job.result.as_mut().and_then(|result| result.bodies.first_mut()) {
        made.file_json = file.into();
    }
    job
}

fn progress_message(progress: Progress) -> FitProgress {
    let phase = match progress.phase {
        Phase::Preparing => FitPhase::Preparing,
        Phase::Trimming => FitPhase::Trimming,
        Phase::Fitting => FitPhase::Fitting,
    };
    FitProgress {
        phase: phase.into(),
        rounds: progress.rounds,
        iterations: progress.iterations,
        gap: progress.gap,
        active_points: progress.active_points as u64,
    }
}

fn result(outcome: &FitOutcome) -> FitResult {
    FitResult {
        bodies: outcome.bodies.iter().map(fitted).collect(),
        left_out_count: outcome.left_out as u64,
        left_out_m: outcome.left_out_m,
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
        }),
        kind: kind.map_or(proto::FittedKind::Unspecified, |(_, kind)| *kind).into(),
        file_json: Default::default(),
        members: made.members.iter().map(|&member| count(member)).collect(),
    }
}

/// What a message says that a job made; none of a kind that this program does not know.
pub(super) fn outcome(result: &FitResult) -> Option<FitOutcome> {
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
            }),
            members: made.members.iter().map(|&member| usize::try_from(member).unwrap_or(usize::MAX)).collect(),
            shortfall: None,
        })
    };
    let bodies = result.bodies.iter().map(body).collect::<Option<_>>()?;
    let left_out = usize::try_from(result.left_out_count).unwrap_or(usize::MAX);
    Some(FitOutcome { bodies, left_out, left_out_m: result.left_out_m })
}
