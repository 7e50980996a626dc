//! Jobs in messages.

use super::error::Invalid;
use super::proto::job::Task;
use super::{derive_wire, fits, hierarchy, proto};
use crate::jobs::Progress;
use crate::store::{Job, JobOutcome, JobState, JobTask};

pub(super) fn id(id: &str, field: &str) -> Result<u64, Invalid> {
    id.parse().map_err(|_| Invalid::new(field, "is no id of a job; give the one that the call which made it returned"))
}

/// A job as it stands.
pub(super) fn job(job: &Job, progress: Option<Progress>) -> proto::Job {
    let Job { id, request_id, task, attempts, state, .. } = job;
    let (state, failure, outcome) = match state {
        JobState::Queued => (proto::JobState::Queued, "", None),
        JobState::Running => (proto::JobState::Running, "", None),
        JobState::Succeeded(outcome) => (proto::JobState::Succeeded, "", Some(outcome)),
        JobState::Failed(why) => (proto::JobState::Failed, why.as_str(), None),
        JobState::Cancelled => (proto::JobState::Cancelled, "", None),
    };
    // The worker may not have reported yet of the job it has begun, or of the one that was
    // cancelled.
    let progress = (state == proto::JobState::Running).then(|| progress.unwrap_or_default());
    let task = match task {
        JobTask::Fit(fit) => {
            let outcome = match outcome {
                Some(JobOutcome::Fit(outcome)) => Some(outcome),
                Some(JobOutcome::Hierarchy(_) | JobOutcome::Derive(_)) | None => None,
            };
            Task::Fit(fits::wire::task(fit, progress, outcome))
        }
        JobTask::Hierarchy(request) => {
            let outcome = match outcome {
                Some(JobOutcome::Hierarchy(outcome)) => Some(outcome),
                Some(JobOutcome::Fit(_) | JobOutcome::Derive(_)) | None => None,
            };
            Task::Hierarchy(hierarchy::wire::task(request, progress, outcome))
        }
        JobTask::Derive(request) => {
            let outcome = match outcome {
                Some(JobOutcome::Derive(outcome)) => Some(outcome),
                Some(JobOutcome::Fit(_) | JobOutcome::Hierarchy(_)) | None => None,
            };
            Task::AllowedPairs(derive_wire::task(request, progress, outcome))
        }
    };
    proto::Job {
        id: id.to_string(),
        request_id: request_id.clone(),
        state: state.into(),
        attempts: *attempts,
        failure: failure.to_owned(),
        task: Some(task),
    }
}
