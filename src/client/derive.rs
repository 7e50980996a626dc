//! Pairs of links that can touch, found by a server.

use std::future::Future;

use super::connection::Client;
use super::jobs::{JobProgress, SubmitError};
use crate::service::derive_wire;
use crate::service::proto::Job;
use crate::service::proto::job::Task;
use crate::service::proto::robot_service_client::RobotServiceClient;
use crate::store::{DeriveOutcome, DeriveRequest};

impl Client {
    /// Has the server prove which pairs of links of a robot can touch at all. `tell` learns of the
    /// job whenever it has changed; when `cancel` resolves, the job is cancelled.
    ///
    /// # Errors
    /// [`SubmitError`].
    pub async fn derive_allowed_pairs(
        &self,
        asked: &DeriveRequest,
        mut tell: impl FnMut(&JobProgress),
        cancel: impl Future<Output = ()>,
    ) -> Result<DeriveOutcome, SubmitError> {
        tokio::pin!(cancel);
        let created = RobotServiceClient::new(self.channel()).derive_allowed_pairs(derive_wire::message(asked)).await;
        let id = created.map_err(|status| self.not_queued(status))?.into_inner().job_id;
        let tell = |job: &Job| tell(&JobProgress::of(&id, job));
        let job = self.follow(&id, tell, cancel).await?;
        match job.task {
            Some(Task::AllowedPairs(task)) => task.result.as_ref().and_then(derive_wire::outcome),
            _ => None,
        }
        .ok_or_else(|| SubmitError::Unproven("nothing".into()))
    }
}
