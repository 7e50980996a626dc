//! One job after the other, on one thread: jobs take a core for seconds to minutes, and queries
//! need the others.

use std::any::Any;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::sync::watch;
use tokio::task::{JoinError, spawn_blocking};

use super::board::{Board, Phase};
use super::execute::{FitOutput, fit_group, fit_mesh};
use super::obstacle::stored_obstacle;
use super::{Jobs, derive, hierarchy};
use crate::fit::{self, Mesh};
use crate::scene::Geometry;
use crate::store::{Catalogue, CatalogueError, FitRequest, FitTask, Job, JobOutcome, JobState, JobTask};

/// Attempts at a job. One that was running whenever the server was killed may be what kills it.
const MAX_ATTEMPTS: u32 = 2;

/// Pause after the disk failed.
const PAUSE: Duration = Duration::from_secs(1);

/// Boxes of joint values between two reports.
const BOXES_TOLD: u32 = 64;

/// What a job made or found, and the bodies to be stored.
pub(super) type Done = (JobOutcome, Vec<Geometry>);

/// The state that the work leaves its job in, and the bodies to be stored.
pub(super) type Ended = (JobState, Vec<Geometry>);

impl Jobs {
    /// Does job after job once the catalogue is loaded, until [`Jobs::stop`]; the jobs that a kill
    /// left running go first.
    pub async fn work(self, mut catalogue: watch::Receiver<Option<Arc<Catalogue>>>) {
        let mut news = self.news();
        let catalogue = tokio::select! {
            Ok(loaded) = catalogue.wait_for(Option::is_some) => loaded.clone(),
            _ = news.wait_for(Board::is_stopping) => None,
            else => None,
        };
        let Some(catalogue) = catalogue else { return };
        for job in self.retry_until_committed(&catalogue, recover).await.into_iter().flatten() {
            self.listener.hear(&job, None);
        }
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
        tracing::info!(id, task = %job.task, attempt = job.attempts, "job begun");
        self.tell(|board| board.begin(id));
        let begun = Instant::now();
        let work = {
            let (jobs, catalogue, job) = (self.clone(), catalogue.clone(), job.clone());
            spawn_blocking(move || jobs.execute(&catalogue, &job))
        };
        let mut news = self.news();
        let done = tokio::select! {
            biased;
            _ = news.wait_for(Board::is_stopping) => None,
            done = work => Some(done),
        };
        match done {
            // The work learns of it, too; whether it ends before the server does is no matter.
            None => {
                self.retry_until_committed(catalogue, move |catalogue| put_back(catalogue, id)).await;
            }
            Some(done) => {
                let (ended, took) = (Arc::new(ended(done)), begun.elapsed());
                let left = ended.clone();
                if let Some(job) =
                    self.retry_until_committed(catalogue, move |catalogue| finish(catalogue, id, &left)).await
                {
                    tracing::info!(id, state = %job.state, "job ended");
                    // One that was cancelled meanwhile was reported then.
                    if job.state == ended.0 {
                        self.listener.hear(&job, Some(took));
                    }
                }
            }
        }
        self.tell(Board::end);
    }

    /// On a thread of its own. An error is the reason why the job fails.
    pub(super) fn execute(&self, catalogue: &Catalogue, job: &Job) -> Result<Done, String> {
        // One that was cancelled since it was claimed, when nobody could tell the board.
        if catalogue.job(job.id).is_none_or(|now| now.state.is_final()) {
            return Err("it was cancelled".into());
        }
        let tell = |note: &dyn Fn(&mut Board) -> bool| {
            let mut goes_on = true;
            self.tell(|board| goes_on = note(board));
            if goes_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let progress = |phase: Phase, said: fit::Progress| tell(&|board| board.note(job.id, phase, said));
        match &job.task {
            JobTask::Fit(FitTask { request, .. }) => {
                let made = fit(catalogue, job.id, request, progress)?;
                Ok((JobOutcome::Fit(made.outcome.clone()), made.into_stored()))
            }
            JobTask::Hierarchy(request) => {
                let [a, b] = request.sets.map(|set| stored_obstacle(catalogue, &set.body));
                let found = hierarchy::solve(request, &[a?, b?], &mut |said| progress(Phase::Solving, said));
                Ok((JobOutcome::Hierarchy(found.map_err(|error| error.to_string())?), Vec::new()))
            }
            JobTask::Derive(request) => {
                let loaded = catalogue.robot(&request.robot).map_err(|error| match error {
                    CatalogueError::NoRobot(id) => format!("robot {id} was deleted meanwhile; load it again"),
                    error => error.to_string(),
                })?;
                let mut boxes = 0;
                // Asked before each box.
                let found = derive::derive(request, &loaded, &mut |at| {
                    let (pairs, looked_at) = ((at.done + 1) as u64, boxes);
                    // Everybody who waits for news wakes up at each report.
                    let said = match at.boxes % BOXES_TOLD {
                        0 => tell(&|board| board.note_boxes(job.id, pairs, looked_at)),
                        _ => ControlFlow::Continue(()),
                    };
                    boxes += u64::from(said.is_continue());
                    said
                });
                Ok((JobOutcome::Derive(found.map_err(|error| error.to_string())?), Vec::new()))
            }
        }
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
                Ok(Err(error)) => tracing::warn!(%error, "a job waits for the disk"),
                Err(error) => tracing::error!(%error, "a change of a job was ended by a panic"),
            }
            let stopping = news.wait_for(Board::is_stopping);
            if tokio::time::timeout(PAUSE, stopping).await.is_ok() {
                return None;
            }
        }
    }
}

/// Executes a fit.
fn fit(
    catalogue: &Catalogue,
    id: u64,
    request: &FitRequest,
    progress: impl FnMut(Phase, fit::Progress) -> ControlFlow<()>,
) -> Result<FitOutput, String> {
    let made = match request.group() {
        Some(group) => {
            let bodies = group.body_ids.iter().map(|id| stored_obstacle(catalogue, id));
            fit_group(request, &bodies.collect::<Result<Vec<_>, _>>()?, progress)
        }
        None => {
            let mesh = catalogue.job_mesh(id).map_err(|error| format!("its points cannot be read: {error}"))?;
            fit_mesh(request, Mesh { points: mesh.0, triangles: mesh.1 }, progress)
        }
    };
    made.map_err(|error| error.to_string())
}

/// Jobs that were running when the server was killed: back into the queue, or given up. Returns
/// the latter.
pub(super) fn recover(catalogue: &Catalogue) -> Result<Vec<Arc<Job>>, CatalogueError> {
    let mut given_up = Vec::new();
    while let Some(job) = catalogue.first_job(&JobState::Running) {
        let job = catalogue.change_job(job.id, Vec::new(), |job| {
            let state = if job.attempts < MAX_ATTEMPTS {
                JobState::Queued
            } else {
                let smaller = match &job.task {
                    JobTask::Fit(_) => "send fewer points or a lower degree",
                    JobTask::Hierarchy(_) => "lower the level or the degree of the sets",
                    JobTask::Derive(_) => "allow fewer boxes",
                };
                JobState::Failed(format!(
                    "the server was killed {} times while it worked on this; give it more memory, or {smaller}",
                    job.attempts
                ))
            };
            Some((state, job.attempts))
        })?;
        tracing::warn!(id = job.id, attempts = job.attempts, state = %job.state, "a job was running when the server was killed");
        if job.state.is_final() {
            given_up.push(job);
        }
    }
    Ok(given_up)
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

/// What the work leaves.
pub(super) fn ended(done: Result<Result<Done, String>, JoinError>) -> Ended {
    let failed = |why| (JobState::Failed(why), Vec::new());
    match done {
        Ok(Ok((outcome, bodies))) => (JobState::Succeeded(outcome), bodies),
        Ok(Err(why)) => failed(why),
        Err(error) => {
            let what =
                error.try_into_panic().map_or_else(|error| error.to_string(), |panic| message(&*panic).to_owned());
            tracing::error!(what, "a job was ended by a panic");
            failed(format!("the job was ended by a panic in the program: {what}; please report it with its input"))
        }
    }
}

/// What a panic said.
fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}
