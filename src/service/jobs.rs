//! JobService: jobs of every kind.

use std::sync::Arc;

use prost::Message;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::limits::{MAX_JOBS_PAGE, MAX_MESSAGE_BYTES, WATCH_PAUSE};
use super::proto::job_service_server::JobService;
use super::proto::{
    self, CancelJobRequest, CancelJobResponse, GetJobRequest, GetJobResponse, ListJobsRequest, ListJobsResponse,
    WatchJobRequest, WatchJobResponse,
};
use super::reason::Reason;
use super::{error, job_wire, wire};
use crate::jobs::{Board, Jobs};
use crate::store::{Catalogue, CatalogueError, Job};

#[derive(Debug)]
pub(super) struct JobCalls {
    pub(super) app: AppState,
    pub(super) jobs: Jobs,
}

#[tonic::async_trait]
impl JobService for JobCalls {
    async fn get_job(&self, request: Request<GetJobRequest>) -> Result<Response<GetJobResponse>, Status> {
        let job = find(&*self.app.catalogue().await?, job_wire::id(&request.get_ref().id, "id")?)?;
        Ok(Response::new(GetJobResponse { job: Some(self.message(&job)) }))
    }

    async fn list_jobs(&self, request: Request<ListJobsRequest>) -> Result<Response<ListJobsResponse>, Status> {
        let (size, after) = wire::page(request.get_ref().page_size, &request.get_ref().page_token);
        let after = after.map(|token| job_wire::id(token, "page_token")).transpose()?;
        let (found, more) = self.app.catalogue().await?.jobs(after, size.min(MAX_JOBS_PAGE));
        let jobs = fitting(found.iter().map(|job| self.message(job)));
        let next_page_token = match jobs.last() {
            Some(last) if more || jobs.len() < found.len() => last.id.clone(),
            _ => String::new(),
        };
        Ok(Response::new(ListJobsResponse { jobs, next_page_token }))
    }

    type WatchJobStream = ReceiverStream<Result<WatchJobResponse, Status>>;

    async fn watch_job(&self, request: Request<WatchJobRequest>) -> Result<Response<Self::WatchJobStream>, Status> {
        let id = job_wire::id(&request.get_ref().id, "id")?;
        let catalogue = self.app.catalogue().await?;
        find(&catalogue, id)?;
        let (sender, stream) = mpsc::channel(1);
        tokio::spawn(watch(self.app.clone(), self.jobs.clone(), id, sender));
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn cancel_job(&self, request: Request<CancelJobRequest>) -> Result<Response<CancelJobResponse>, Status> {
        let id = job_wire::id(&request.get_ref().id, "id")?;
        let jobs = self.jobs.clone();
        let job = self.app.change("id", move |catalogue| jobs.cancel(catalogue, id)).await?;
        Ok(Response::new(CancelJobResponse { job: Some(self.message(&job)) }))
    }
}

impl JobCalls {
    fn message(&self, job: &Job) -> proto::Job {
        job_wire::job(job, self.jobs.news().borrow().progress(job.id))
    }
}

/// As many of the jobs, at least one, as fit in a message.
fn fitting(jobs: impl Iterator<Item = proto::Job>) -> Vec<proto::Job> {
    let (mut bytes, mut fitting) = (0, Vec::new());
    for job in jobs {
        // With its tag and length; the token comes on top.
        bytes += job.encoded_len() + 16;
        if bytes > MAX_MESSAGE_BYTES - 64 && !fitting.is_empty() {
            break;
        }
        fitting.push(job);
    }
    fitting
}

fn find(catalogue: &Catalogue, id: u64) -> Result<Arc<Job>, Status> {
    catalogue.job(id).ok_or_else(|| error::catalogue(&CatalogueError::NoJob(id.to_string()), "id"))
}

/// Sends the job as it stands whenever it has changed, until it has ended or nobody listens. A
/// message is made when there is space for it, so who reads slowly gets the latest.
async fn watch(app: AppState, jobs: Jobs, id: u64, sender: mpsc::Sender<Result<WatchJobResponse, Status>>) {
    let (mut news, mut sent) = (jobs.news(), None);
    while let Ok(space) = sender.reserve().await {
        let (progress, stopping) = {
            let board: &Board = &news.borrow_and_update();
            (board.progress(id), board.is_stopping())
        };
        let job = match app.catalogue().await.and_then(|catalogue| find(&catalogue, id)) {
            Ok(job) => job,
            Err(status) => return space.send(Err(status)),
        };
        let message = job_wire::job(&job, progress);
        if sent.as_ref() != Some(&message) {
            sent = Some(message.clone());
            space.send(Ok(WatchJobResponse { job: Some(message) }));
        } else if stopping {
            let why = "the server stops; watch the job again when it is back, it goes on then";
            return space.send(Err(error::unavailable(Reason::Stopping, why)));
        }
        if job.state.is_final() {
            return;
        }
        if !stopping {
            tokio::time::sleep(WATCH_PAUSE).await;
            tokio::select! {
                _ = news.changed() => {}
                () = sender.closed() => return,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_ends_where_a_message_would() {
        let jobs =
            |bytes: usize| (0..5).map(move |_| proto::Job { failure: "x".repeat(bytes), ..proto::Job::default() });
        for (bytes, count) in [(10, 5), (1 << 20, 3), (5 << 20, 1)] {
            let page = fitting(jobs(bytes));
            assert_eq!(page.len(), count);
            let page = ListJobsResponse { jobs: page, next_page_token: u64::MAX.to_string() };
            assert!(count == 1 || page.encoded_len() <= MAX_MESSAGE_BYTES);
        }
    }
}
