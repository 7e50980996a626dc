//! FitService.

mod request;
mod submit;
mod upload;
mod wire;

pub use submit::{SubmitError, submit};

use std::sync::Arc;

use prost::Message;
use tokio::sync::{Semaphore, mpsc};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

use super::app_state::AppState;
use super::limits::{MAX_FITS_PAGE, MAX_MESSAGE_BYTES, MAX_UPLOADS, WATCH_PAUSE};
use super::proto::fit_service_server::FitService;
use super::proto::{
    CancelFitRequest, CancelFitResponse, CreateFitRequest, CreateFitResponse, FitJob, GetFitRequest, GetFitResponse,
    ListFitsRequest, ListFitsResponse, WatchFitRequest, WatchFitResponse,
};
use super::{error, wire as shared};
use crate::jobs::{Board, Jobs};
use crate::store::{Catalogue, CatalogueError, Job, MAX_FILE_BYTES};

// A job's message with its file, and with all that it says besides.
const _: () = assert!(MAX_FILE_BYTES + (32 << 10) < MAX_MESSAGE_BYTES);

#[derive(Debug)]
pub(super) struct Fits {
    app: AppState,
    jobs: Jobs,
    /// Each holds its points in memory; further ones wait unread.
    uploads: Semaphore,
}

impl Fits {
    pub(super) fn new(app: AppState, jobs: Jobs) -> Self {
        Self { app, jobs, uploads: Semaphore::new(MAX_UPLOADS) }
    }
}

#[tonic::async_trait]
impl FitService for Fits {
    async fn create_fit(
        &self,
        request: Request<Streaming<CreateFitRequest>>,
    ) -> Result<Response<CreateFitResponse>, Status> {
        let _place = self.uploads.acquire().await;
        let upload = upload::receive(request.into_inner()).await?;
        let new = self.app.prove(move || upload.into_job()).await??;
        let jobs = self.jobs.clone();
        let create = move |catalogue: &Catalogue| jobs.create(catalogue, new);
        let (job, created) = self.app.change("header.request_id", create).await?;
        Ok(Response::new(CreateFitResponse { job: Some(self.message(&job).await?), created }))
    }

    async fn get_fit(&self, request: Request<GetFitRequest>) -> Result<Response<GetFitResponse>, Status> {
        let job = find(&*self.app.catalogue().await?, wire::id(&request.get_ref().id, "id")?)?;
        Ok(Response::new(GetFitResponse { job: Some(self.message(&job).await?) }))
    }

    async fn list_fits(&self, request: Request<ListFitsRequest>) -> Result<Response<ListFitsResponse>, Status> {
        let (size, after) = shared::page(request.get_ref().page_size, &request.get_ref().page_token);
        let after = after.map(|token| wire::id(token, "page_token")).transpose()?;
        let (found, more) = self.app.catalogue().await?.jobs(after, size.min(MAX_FITS_PAGE));
        let progress = self.jobs.news();
        let jobs = fitting(found.iter().map(|job| wire::job(job, progress.borrow().progress(job.id))));
        let next_page_token = match jobs.last() {
            Some(last) if more || jobs.len() < found.len() => last.id.clone(),
            _ => String::new(),
        };
        Ok(Response::new(ListFitsResponse { jobs, next_page_token }))
    }

    type WatchFitStream = ReceiverStream<Result<WatchFitResponse, Status>>;

    async fn watch_fit(&self, request: Request<WatchFitRequest>) -> Result<Response<Self::WatchFitStream>, Status> {
        let id = wire::id(&request.get_ref().id, "id")?;
        let catalogue = self.app.catalogue().await?;
        find(&catalogue, id)?;
        let (sender, stream) = mpsc::channel(1);
        tokio::spawn(watch(self.app.clone(), self.jobs.clone(), id, sender));
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn cancel_fit(&self, request: Request<CancelFitRequest>) -> Result<Response<CancelFitResponse>, Status> {
        let id = wire::id(&request.get_ref().id, "id")?;
        let jobs = self.jobs.clone();
        let job = self.app.change("id", move |catalogue| jobs.cancel(catalogue, id)).await?;
        Ok(Response::new(CancelFitResponse { job: Some(self.message(&job).await?) }))
    }
}

impl Fits {
    async fn message(&self, job: &Job) -> Result<FitJob, Status> {
        let message = wire::job(job, self.jobs.news().borrow().progress(job.id));
        complete(&self.app, job, message).await
    }
}

/// A job's message with the file that the job made, if it made one.
async fn complete(app: &AppState, job: &Job, message: FitJob) -> Result<FitJob, Status> {
    if !wire::has_file(job) {
        return Ok(message);
    }
    let (catalogue, id) = (app.catalogue().await?, job.id);
    let file = app.solve(move || catalogue.job_file(id)).await?.map_err(|error| error::catalogue(&error, "id"))?;
    Ok(wire::with_file(message, file.unwrap_or_default()))
}

/// As many of the jobs, at least one, as fit in a message.
fn fitting(jobs: impl Iterator<Item = FitJob>) -> Vec<FitJob> {
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
async fn watch(app: AppState, jobs: Jobs, id: u64, sender: mpsc::Sender<Result<WatchFitResponse, Status>>) {
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
        let message = wire::job(&job, progress);
        if sent.as_ref() != Some(&message) {
            sent = Some(message.clone());
            let message = complete(&app, &job, message).await;
            space.send(message.map(|job| WatchFitResponse { job: Some(job) }));
        } else if stopping {
            let why = "the server stops; watch the job again when it is back, it goes on then";
            return space.send(Err(error::unavailable("STOPPING", why)));
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
        let jobs = |bytes: usize| (0..5).map(move |_| FitJob { failure: "x".repeat(bytes), ..FitJob::default() });
        for (bytes, count) in [(10, 5), (1 << 20, 3), (5 << 20, 1)] {
            let page = fitting(jobs(bytes));
            assert_eq!(page.len(), count);
            let page = ListFitsResponse { jobs: page, next_page_token: u64::MAX.to_string() };
            assert!(count == 1 || page.encoded_len() <= MAX_MESSAGE_BYTES);
        }
    }
}
