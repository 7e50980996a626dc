//! The jobs of the catalogue. The points of fits stay on disk until somebody fits them, and go when
//! the job has ended.

use std::sync::Arc;

use crate::body::BodyId;
use crate::scene::Geometry;
use crate::store::JobMesh;
use crate::store::derive::DeriveRequest;
use crate::store::hierarchy::HierarchyRequest;
use crate::store::job::{FitTask, Job, JobState, JobTask, MAX_ENDED_JOBS, MAX_QUEUED_JOBS, NewJob};
use crate::store::rows::{JOBS, POINTS, TRIANGLES, json};

use super::{Catalogue, CatalogueError, State, page, put_bodies};

impl Catalogue {
    /// One job by id.
    pub fn job(&self, id: u64) -> Option<Arc<Job>> {
        self.read(|state| state.jobs.get(&id).cloned())
    }

    /// Up to `count` jobs, oldest first, from the first one after `after`; and whether more follow.
    pub fn jobs(&self, after: Option<u64>, count: usize) -> (Vec<Arc<Job>>, bool) {
        self.read(|state| page(&state.jobs, after.as_ref(), count))
    }

    /// The oldest job in this state.
    pub fn first_job(&self, wanted: &JobState) -> Option<Arc<Job>> {
        self.read(|state| state.jobs.values().find(|job| job.state == *wanted).cloned())
    }

    /// The job of a request id that a client has given, as long as it is known.
    pub fn job_of_request(&self, request_id: &str) -> Option<Arc<Job>> {
        self.read(|state| state.job_of_request(request_id))
    }

    /// The points of a fit that has not ended, metres, and the triangles between them; none of
    /// either for groups.
    ///
    /// # Errors
    /// When it has ended, when the job is no fit, or when the disk fails.
    pub fn job_mesh(&self, id: u64) -> Result<JobMesh, CatalogueError> {
        let mesh = self.writer()?.mesh(id)?;
        mesh.ok_or_else(|| CatalogueError::NoJob(id.to_string()))
    }

    /// Queues a job. The one that was there first when the request id is known; returns whether it
    /// is new. The oldest of too many jobs that have ended is forgotten.
    ///
    /// # Errors
    /// When the request id was used for another content, when it is about a body that is not there,
    /// when too many jobs wait, or when the disk fails.
    pub fn create_job(&self, new: NewJob) -> Result<(Arc<Job>, bool), CatalogueError> {
        let mut store = self.writer()?;
        let NewJob { request_id, digest, task, coordinates, corners } = new;
        let (known, missing, queued, ended, id) = self.read(|state| {
            let jobs = || state.jobs.values();
            let known = state.job_of_request(&request_id);
            let queued = jobs().filter(|job| job.state == JobState::Queued).count();
            let ended: Vec<u64> = jobs().filter(|job| job.state.is_final()).map(|job| job.id).collect();
            // The latest job is never forgotten, so no id is given twice.
            (known, state.missing(&task), queued, ended, state.jobs.last_key_value().map_or(1, |(last, _)| last + 1))
        });
        match (known, missing) {
            (Some(known), _) if known.digest == digest => return Ok((known, false)),
            (Some(known), _) => return Err(CatalogueError::RequestUsed { request_id, job: known.id }),
            (None, Some(missing)) => return Err(missing),
            (None, None) if queued >= MAX_QUEUED_JOBS => return Err(CatalogueError::QueueFull),
            (None, None) => {}
        }
        let job = Arc::new(Job { id, request_id, digest, task, attempts: 0, state: JobState::Queued });
        let forgotten = &ended[..ended.len().saturating_sub(MAX_ENDED_JOBS)];
        self.commit(&mut store, |transaction| {
            if matches!(job.task, JobTask::Fit(_)) {
                transaction.open_table(POINTS)?.insert(id, coordinates.as_slice())?;
            }
            if !corners.is_empty() {
                transaction.open_table(TRIANGLES)?.insert(id, corners.as_slice())?;
            }
            let mut jobs = transaction.open_table(JOBS)?;
            jobs.insert(id, json(&*job)?.as_slice())?;
            for id in forgotten {
                jobs.remove(id)?;
            }
            Ok(())
        })?;
        self.write(|state| {
            forgotten.iter().for_each(|id| drop(state.jobs.remove(id)));
            state.jobs.insert(id, job.clone())
        });
        tracing::debug!(id, task = %job.task, "job queued");
        Ok((job, true))
    }

    /// Moves a job on to the state and number of attempts that `change` says, storing its bodies
    /// along with that; `None` leaves all as it is. Returns the job
    /// as it is then. A job that ends loses its points.
    ///
    /// # Errors
    /// When there is no such job, or when the disk fails.
    pub fn change_job(
        &self,
        id: u64,
        bodies: Vec<Geometry>,
        change: impl FnOnce(&Job) -> Option<(JobState, u32)>,
    ) -> Result<Arc<Job>, CatalogueError> {
        let mut store = self.writer()?;
        let job = self.job(id).ok_or_else(|| CatalogueError::NoJob(id.to_string()))?;
        let Some((state, attempts)) = change(&job) else { return Ok(job) };
        let next = Arc::new(Job { state, attempts, ..(*job).clone() });
        let fresh = self.read(|state| state.fresh(bodies.clone())).or_else(|error| {
            // The bodies are worth keeping without their ladder.
            tracing::warn!(id, %error, "a ladder cannot be stored");
            let bodies = bodies.into_iter().filter(|body| !matches!(body, Geometry::Ladder(_)));
            self.read(|state| state.fresh(bodies.collect()))
        })?;
        self.commit(&mut store, |transaction| {
            put_bodies(transaction, &fresh)?;
            if next.state.is_final() {
                transaction.open_table(POINTS)?.remove(id)?;
                transaction.open_table(TRIANGLES)?.remove(id)?;
            }
            transaction.open_table(JOBS)?.insert(id, json(&*next)?.as_slice())?;
            Ok(())
        })?;
        self.write(|state| {
            state.keep(fresh);
            state.jobs.insert(id, next.clone())
        });
        tracing::debug!(id, attempts, state = %next.state, "job moved on");
        Ok(next)
    }
}

impl State {
    fn job_of_request(&self, request_id: &str) -> Option<Arc<Job>> {
        let known = |job: &&Arc<Job>| !request_id.is_empty() && job.request_id == request_id;
        self.jobs.values().find(known).cloned()
    }

    /// The first body that a task is about and that is not there.
    fn missing(&self, task: &JobTask) -> Option<CatalogueError> {
        let is_missing = |id: &BodyId| !self.bodies.contains_key(id);
        match task {
            JobTask::Fit(FitTask { request, .. }) => {
                let mut ids = request.group()?.body_ids.iter().enumerate();
                ids.find(|(_, id)| is_missing(id)).map(|(index, id)| CatalogueError::NoMember { index, id: *id })
            }
            JobTask::Hierarchy(HierarchyRequest { sets, .. }) => {
                let mut ids = sets.iter().map(|set| set.body).enumerate();
                ids.find(|(_, id)| is_missing(id)).map(|(index, id)| CatalogueError::NoSet { index, id })
            }
            JobTask::Derive(DeriveRequest { robot, .. }) => {
                (!self.robots.contains_key(robot)).then_some(CatalogueError::NoRobot(*robot))
            }
        }
    }
}
