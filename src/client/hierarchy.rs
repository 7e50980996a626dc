//! Solves of the hierarchy made by a server.

use std::future::Future;

use super::connection::Client;
use super::jobs::{JobProgress, SubmitError};
use crate::service::hierarchy::wire;
use crate::service::proto::Job;
use crate::service::proto::hierarchy_service_client::HierarchyServiceClient;
use crate::service::proto::job::Task;
use crate::store::{HierarchyOutcome, HierarchyRequest};

impl Client {
    /// Has the server bracket a measure of two sets that it has stored. `tell` learns of the job
    /// whenever it has changed; when `cancel` resolves, the job is cancelled.
    ///
    /// # Errors
    /// [`SubmitError`].
    pub async fn solve_hierarchy(
        &self,
        asked: &HierarchyRequest,
        mut tell: impl FnMut(&JobProgress),
        cancel: impl Future<Output = ()>,
    ) -> Result<HierarchyOutcome, SubmitError> {
        tokio::pin!(cancel);
        let created = HierarchyServiceClient::new(self.channel()).create_hierarchy_solve(wire::message(asked)).await;
        let id = created.map_err(|status| self.not_queued(status))?.into_inner().job_id;
        let tell = |job: &Job| tell(&JobProgress::of(&id, job));
        let job = self.follow(&id, tell, cancel).await?;
        match job.task {
            Some(Task::Hierarchy(solve)) => solve.result.as_ref().map(wire::outcome),
            _ => None,
        }
        .ok_or_else(|| SubmitError::Unproven("nothing".into()))
    }
}
