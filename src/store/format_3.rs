//! Rows of format 3 that have another form since: jobs, which were all fits.

use serde::Deserialize;

use super::job::{FitOutcome, FitTask, Job, JobOutcome, JobState, JobTask};
use super::request::FitRequest;

/// Its number.
pub(super) const FORMAT_3: u64 = 3;

/// A job of format 3.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FitJob {
    id: u64,
    request_id: String,
    digest: String,
    request: FitRequest,
    points: usize,
    attempts: u32,
    state: State,
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum State {
    Queued,
    Running,
    Succeeded(FitOutcome),
    Failed(String),
    Cancelled,
}

impl From<FitJob> for Job {
    fn from(FitJob { id, request_id, digest, request, points, attempts, state }: FitJob) -> Self {
        let state = match state {
            State::Queued => JobState::Queued,
            State::Running => JobState::Running,
            State::Succeeded(outcome) => JobState::Succeeded(JobOutcome::Fit(outcome)),
            State::Failed(why) => JobState::Failed(why),
            State::Cancelled => JobState::Cancelled,
        };
        Self { id, request_id, digest, task: JobTask::Fit(FitTask { request, points }), attempts, state }
    }
}
