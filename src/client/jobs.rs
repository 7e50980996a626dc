//! Jobs of a server, followed to their end.

use std::future::Future;

use tonic::{Code, Status};

use super::connection::Client;
use super::error::ClientError;
use crate::jobs::Progress;
use crate::service::job_wire;
use crate::service::proto::job_service_client::JobServiceClient;
use crate::service::proto::{CancelJobRequest, Job, JobState, WatchJobRequest};

/// How far a job is.
#[derive(Clone, Debug)]
pub struct JobProgress {
    /// Id of the job.
    pub id: String,
    /// What it is doing; none while it waits.
    pub progress: Option<Progress>,
}

impl JobProgress {
    pub(super) fn of(id: &str, job: &Job) -> Self {
        Self { id: id.into(), progress: job_wire::progress(job) }
    }
}

/// Why a job of a server made nothing.
#[derive(Debug, thiserror::Error)]
pub enum SubmitError {
    /// There is no server, or it refused the job.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// The server has no jobs.
    #[error(
        "the server at {0} was built without fitting; fit without --server and `sublevel push` the bodies, or solve with `sublevel hierarchy`"
    )]
    Unable(String),
    /// The connection broke while the job was under way.
    #[error(
        "lost the server while it worked on job {id}, which goes on there when it is back: {source}; GetJob says how it ended"
    )]
    Lost {
        /// The job.
        id: String,
        /// What went wrong.
        source: ClientError,
    },
    /// What was sent cannot be fitted or solved.
    #[error("{0}")]
    Failed(String),
    /// The job was cancelled, here or by another client.
    #[error("the job was cancelled")]
    Cancelled,
    /// The server sent something that is not what the job makes.
    #[error("the server sent what the job does not make: {0}; are the versions the same?")]
    Unproven(String),
}

impl Client {
    /// Why a call that makes a job failed.
    pub(super) fn not_queued(&self, status: Status) -> SubmitError {
        match status.code() {
            Code::Unimplemented => SubmitError::Unable(self.url().to_owned()),
            _ => self.refused()(status).into(),
        }
    }

    /// Watches a job until it has succeeded. `tell` is called whenever it has changed; when
    /// `cancel` resolves, it is cancelled.
    ///
    /// # Errors
    /// [`SubmitError`], also of jobs that end otherwise.
    pub(super) async fn follow(
        &self,
        id: &str,
        mut tell: impl FnMut(&Job),
        mut cancel: impl Future<Output = ()> + Unpin,
    ) -> Result<Job, SubmitError> {
        let lost = |status| SubmitError::Lost { id: id.to_owned(), source: self.refused()(status) };
        let mut client = JobServiceClient::new(self.channel());
        let request = WatchJobRequest { id: id.to_owned() };
        let mut watch = client.clone().watch_job(request).await.map_err(lost)?.into_inner();
        let (mut job, mut cancelling) = (Job::default(), false);
        loop {
            tokio::select! {
                heard = watch.message() => match heard.map_err(lost)?.and_then(|heard| heard.job) {
                    Some(heard) => job = heard,
                    None => break,
                },
                () = &mut cancel, if !cancelling => {
                    cancelling = true;
                    client.cancel_job(CancelJobRequest { id: id.to_owned() }).await.map_err(lost)?;
                }
            }
            tell(&job);
        }
        match job.state() {
            JobState::Succeeded => Ok(job),
            JobState::Cancelled => Err(SubmitError::Cancelled),
            _ => Err(SubmitError::Failed(job.failure)),
        }
    }
}
