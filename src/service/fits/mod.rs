//! FitService: meshes, points and groups become jobs.

mod content;
pub(crate) mod request;
pub(crate) mod wire;

use tokio::sync::Semaphore;
use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::limits::MAX_UPLOADS;
use super::proto::fit_service_server::FitService;
use super::proto::{CreateFitRequest, CreateFitResponse};
use crate::jobs::Jobs;
use crate::store::Catalogue;

#[derive(Debug)]
pub(super) struct Fits {
    app: AppState,
    jobs: Jobs,
    /// Each holds its points in memory; further ones wait.
    reading: Semaphore,
}

impl Fits {
    pub(super) fn new(app: AppState, jobs: Jobs) -> Self {
        Self { app, jobs, reading: Semaphore::new(MAX_UPLOADS) }
    }
}

#[tonic::async_trait]
impl FitService for Fits {
    async fn create_fit(&self, request: Request<CreateFitRequest>) -> Result<Response<CreateFitResponse>, Status> {
        let _place = self.reading.acquire().await;
        let (app, request) = (self.app.clone(), request.into_inner());
        let new = self.app.prove(move || content::job(request, app.blobs())).await??;
        let jobs = self.jobs.clone();
        let create = move |catalogue: &Catalogue| jobs.create(catalogue, new);
        let (job, created) = self.app.change("request_id", create).await?;
        Ok(Response::new(CreateFitResponse { job_id: job.id.to_string(), created }))
    }
}
