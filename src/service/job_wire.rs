//! Jobs in messages.

use super::error::Invalid;
use super::proto::job::Task;
use super::{derive_wire, fits, hierarchy, proto};
use crate::jobs::{Phase, Progress};
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

/// How far a job of a message is; none while it waits.
pub(crate) fn progress(job: &proto::Job) -> Option<Progress> {
    let solving = Progress { phase: Phase::Solving, ..Progress::default() };
    match job.task.as_ref()? {
        Task::Fit(task) => task.progress.as_ref().map(fits::wire::progress),
        Task::Hierarchy(task) => task.progress.as_ref().map(|said| Progress { iterations: said.iterations, ..solving }),
        Task::AllowedPairs(task) => {
            task.progress.as_ref().map(|said| Progress { rounds: said.pairs_begun, iterations: said.boxes, ..solving })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::DeriveRequest;

    #[test]
    fn progress_that_is_written_is_read() {
        let robot = "0".repeat(64).parse().expect("an id");
        let request = DeriveRequest { robot, margin_m: 0.0, max_boxes: 1, resolution_m: 0.1 };
        let with = |task| proto::Job { task: Some(task), ..proto::Job::default() };
        let said = Progress { phase: Phase::Solving, rounds: 3, iterations: 17, ..Progress::default() };
        let of_pairs = |said| with(Task::AllowedPairs(derive_wire::task(&request, said, None)));
        assert_eq!(progress(&of_pairs(Some(said))), Some(said));
        assert_eq!(progress(&of_pairs(None)), None);
        for (phase, message) in [
            (Phase::Preparing, proto::FitPhase::Preparing),
            (Phase::Trimming, proto::FitPhase::Trimming),
            (Phase::Solving, proto::FitPhase::Fitting),
        ] {
            let message =
                proto::FitProgress { phase: message.into(), rounds: 2, iterations: 9, gap: 0.5, active_points: 40 };
            let fit = proto::FitTask { progress: Some(message), ..proto::FitTask::default() };
            let said = Progress { phase, rounds: 2, iterations: 9, gap: 0.5, active_points: 40 };
            assert_eq!(progress(&with(Task::Fit(fit))), Some(said));
        }
        let solve = proto::HierarchyTask {
            progress: Some(proto::HierarchyProgress { iterations: 4 }),
            ..proto::HierarchyTask::default()
        };
        let said = Progress { phase: Phase::Solving, iterations: 4, ..Progress::default() };
        assert_eq!(progress(&with(Task::Hierarchy(solve))), Some(said));
        assert_eq!(progress(&proto::Job::default()), None);
    }
}
