//! One job after the other, on one thread: fits take a core for seconds, and queries need the
//! others.

use std::any::Any;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;
use tokio::task::{JoinError, spawn_blocking};

use super::{Board, FitOutput, Jobs, Phase, fit_group, fit_mesh};
use crate::body::{BodyId, Obstacle, Shape};
use crate::fit::{self, Mesh};
use crate::scene::Geometry;
use crate::store::{Catalogue, CatalogueError, Job, JobState};

/// Attempts at a job. One that was running whenever the server was killed may be what kills it.
const MAX_ATTEMPTS: u32 = 2;

/// Pause after the disk failed.
const PAUSE: Duration = Duration::from_secs(1);

type Fitted = Result<Result<FitOutput, String>, JoinError>;

/// The state that a fit leaves its job in, and the bodies to be stored.
pub(super) type Ended = (JobState, Vec<Geometry>);

impl Jobs {
    /// Fits job after job once the catalogue is loaded, until [`Jobs::stop`]; the jobs that a kill
    /// left running go first.
    pub async fn work(self, mut catalogue: watch::Receiver<Option<Arc<Catalogue>>>) {
        let mut news = self.news();
        let catalogue = tokio::select! {
            Ok(loaded) = catalogue.wait_for(Option::is_some) => loaded.clone(),
            _ = news.wait_for(Board::is_stopping) => None,
            else => None,
        };
        let Some(catalogue) = catalogue else { return };
        self.retry_until_committed(&catalogue, recover).await;
        self.tell(|_| {});
        while !news.borrow_and_update().is_stopping() {
            match self.retry_until_committed(&catalogue, claim).await.flatten() {
                Some(job) => self.attempt(&catalogue, &job).await,
                None => drop(news.changed().await),
            }
        }
    }

    /// One attempt at a job that was claimed.
    async fn attempt(&self, catalogue: &Arc<Catalogue>, job: &Arc<Job>) {
        let id = job.id;
        tracing::info!(id, name = job.request.name, points = job.points, attempt = job.attempts, "fit job begun");
        self.tell(|board| board.begin(id));
        let fit = {
            let (jobs, catalogue, job) = (self.clone(), catalogue.clone(), job.clone());
            spawn_blocking(move || jobs.fit(&catalogue, &job))
        };
        let mut news = self.news();
        let fitted = tokio::select! {
            biased;
            _ = news.wait_for(Board::is_stopping) => None,
            fitted = fit => Some(fitted),
        };
        match fitted {
            // The fit learns of it, too; whether it ends before the server does is no matter.
            None => {
                self.retry_until_committed(catalogue, move |catalogue| put_back(catalogue, id)).await;
            }
            Some(fitted) => {
                let ended = ended(fitted);
                if let Some(job) =
                    self.retry_until_committed(catalogue, move |catalogue| finish(catalogue, id, &ended)).await
                {
                    tracing::info!(id, state = %job.state, "fit job ended");
                }
            }
        }
        self.tell(Board::end);
    }

    /// On a thread of its own. An error is the reason why the job fails.
    pub(super) fn fit(&self, catalogue: &Catalogue, job: &Job) -> Result<FitOutput, String> {
        // A job that was cancelled since it was claimed, when nobody could tell the board, has no
        // points any more.
        let mesh = catalogue.job_mesh(job.id).map_err(|error| format!("its points cannot be read: {error}"))?;
        let progress = |phase: Phase, said: fit::Progress| {
            let mut goes_on = true;
            self.tell(|board| goes_on = board.note(job.id, phase, said));
            if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let made = match job.request.group() {
            Some(group) => {
                let body = |id| {
                    obstacle(&catalogue.geometry(id).map_err(|error| unusable(id, &error))?)
                        .ok_or_else(|| format!("body {id} is no single body; a group takes bodies and sos-bodies"))
                };
                let bodies = group.body_ids.iter().map(body).collect::<Result<Vec<_>, _>>()?;
                fit_group(&job.request, &bodies, progress)
            }
            None => fit_mesh(&job.request, Mesh { points: mesh.0, triangles: mesh.1 }, progress),
        };
        made.map_err(|error| error.to_string())
    }

    /// A change of the catalogue, again and again until the disk takes it or the server stops.
    pub(super) async fn retry_until_committed<T: Send + 'static>(
        &self,
        catalogue: &Arc<Catalogue>,
        change: impl Fn(&Catalogue) -> Result<T, CatalogueError> + Send + Sync + 'static,
    ) -> Option<T> {
        let (mut news, change) = (self.news(), Arc::new(change));
        loop {
            let (catalogue, change) = (catalogue.clone(), change.clone());
            match spawn_blocking(move || change(&catalogue)).await {
                Ok(Ok(done)) => return Some(done),
                Ok(Err(error)) => tracing::warn!(%error, "a fit job waits for the disk"),
                Err(error) => tracing::error!(%error, "a change of a fit job was ended by a panic"),
            }
            let stopping = news.wait_for(Board::is_stopping);
            if tokio::time::timeout(PAUSE, stopping).await.is_ok() {
                return None;
            }
        }
    }
}

/// Why a group cannot have a body.
fn unusable(id: &BodyId, error: &CatalogueError) -> String {
    match error {
        CatalogueError::NoBody(_) => format!("body {id} was deleted meanwhile; create it again"),
        error => error.to_string(),
    }
}

/// What a group can hold.
fn obstacle(geometry: &Geometry) -> Option<Obstacle> {
    match geometry {
        Geometry::Solid(shape) => match &**shape {
            Shape::Body(body) => Some(Obstacle::from((**body).clone())),
            Shape::Compound(_) => None,
        },
        Geometry::SosBody(body) => Some(Obstacle::from((**body).clone())),
        Geometry::Ladder(_) | Geometry::HalfSpace(_) => None,
    }
}

/// Jobs that were running when the server was killed: back into the queue, or given up.
pub(super) fn recover(catalogue: &Catalogue) -> Result<(), CatalogueError> {
    while let Some(job) = catalogue.first_job(&JobState::Running) {
        let job = catalogue.change_job(job.id, Vec::new(), |job| {
            let state = if job.attempts < MAX_ATTEMPTS {
                JobState::Queued
            } else {
                JobState::Failed(format!(
                    "the server was killed {} times while it fitted this; give it more memory, or send fewer points or a \
                     lower degree",
                    job.attempts
                ))
            };
            Some((state, job.attempts))
        })?;
        tracing::warn!(id = job.id, attempts = job.attempts, state = %job.state, "a fit job was running when the server was killed");
    }
    Ok(())
}

/// The oldest job that waits is running now.
pub(super) fn claim(catalogue: &Catalogue) -> Result<Option<Arc<Job>>, CatalogueError> {
    let Some(job) = catalogue.first_job(&JobState::Queued) else { return Ok(None) };
    let is_queued = |job: &Job| job.state == JobState::Queued;
    let job = catalogue
        .change_job(job.id, Vec::new(), |job| is_queued(job).then_some((JobState::Running, job.attempts + 1)))?;
    // Cancelled meanwhile: who asks for news learns of it and comes back.
    Ok(Some(job).filter(|job| job.state == JobState::Running))
}

/// Back into the queue, as if it had not been begun.
pub(super) fn put_back(catalogue: &Catalogue, id: u64) -> Result<(), CatalogueError> {
    let is_running = |job: &Job| job.state == JobState::Running;
    catalogue.change_job(id, Vec::new(), |job| {
        is_running(job).then(|| (JobState::Queued, job.attempts.saturating_sub(1)))
    })?;
    Ok(())
}

/// The end of a job, unless it was cancelled meanwhile.
pub(super) fn finish(catalogue: &Catalogue, id: u64, ended: &Ended) -> Result<Arc<Job>, CatalogueError> {
    let (state, bodies) = ended;
    let is_running = |job: &Job| job.state == JobState::Running;
    catalogue.change_job(id, bodies.clone(), |job| is_running(job).then(|| (state.clone(), job.attempts)))
}

/// What a fit leaves.
pub(super) fn ended(fitted: Fitted) -> Ended {
    let failed = |why| (JobState::Failed(why), Vec::new());
    match fitted {
        Ok(Ok(output)) => (JobState::Succeeded(output.outcome.clone()), output.into_stored()),
        Ok(Err(why)) => failed(why),
        Err(error) => {
            let what =
                error.try_into_panic().map_or_else(|error| error.to_string(), |panic| message(&*panic).to_owned());
            tracing::error!(what, "a fit was ended by a panic");
            failed(format!("the fit was ended by a panic in the program: {what}; please report it with the points"))
        }
    }
}

/// What a panic said.
fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}
