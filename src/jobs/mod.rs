//! Jobs, which are fits, solves of the hierarchy and pairs of links: queue, progress, cancel,
//! restart.
//!
//! The catalogue stores the jobs; what is decided there is final, and the worker only follows. A
//! job that is cancelled is CANCELLED on disk first and stopped then; a result counts only if its
//! job is still running when it comes. So nothing depends on when the work learns of it, and a kill
//! at any time leaves a state that was acknowledged.
//!
//! `request` checks what fits are asked for, `execute` executes them, for jobs and the command
//! line; `hierarchy` does both for solves, `derive` for pairs of links; `link_body` makes bodies of
//! the links of robots; `obstacle` says which stored bodies can be used; `worker` does one job
//! after the other; `board` is where it says how far it is, and where everybody waits for news;
//! `ended_job` reports jobs that have ended, for metrics.

mod board;
mod derive;
mod ended_job;
mod execute;
mod hierarchy;
mod link_body;
mod obstacle;
mod request;
mod worker;

pub use crate::fit::Mesh;
pub use board::{Board, Phase, Progress};
pub use derive::{MAX_DERIVE_BOXES, check_derive, derive};
pub use execute::{Failure, FitOutput, Shapes, fit_group, fit_mesh};
pub use hierarchy::{check_solve, check_solve_of, solve};
pub use link_body::{LinkBodyError, LinkFit, exact_parts, fit_link, has_mesh, link_mesh, link_request};
pub use obstacle::{NotASet, obstacle};
pub use request::{MESH_FORMATS, RequestError, body_name, check, read_mesh};

use std::sync::Arc;
use std::time::Duration;

use tokio::sync::watch;

use crate::store::{Catalogue, CatalogueError, Job, JobState, NewJob};
use ended_job::Listener;

/// The jobs of one server. Clones are the same jobs.
#[derive(Clone, Debug, Default)]
pub struct Jobs {
    board: Arc<watch::Sender<Board>>,
    listener: Listener,
}

impl Jobs {
    /// Jobs that are reported once they have ended, with how long the last attempt took if
    /// it came to its end.
    pub fn heard_by(listener: impl Fn(&Job, Option<Duration>) + Send + Sync + 'static) -> Self {
        Self { listener: Listener::new(listener), ..Self::default() }
    }

    /// Queues a job, see [`Catalogue::create_job`]. Blocks on the disk, as all changes do.
    ///
    /// # Errors
    /// When the catalogue refuses it.
    pub fn create(&self, catalogue: &Catalogue, job: NewJob) -> Result<(Arc<Job>, bool), CatalogueError> {
        let created = catalogue.create_job(job)?;
        self.tell(|_| {});
        Ok(created)
    }

    /// Cancels a job that has not ended, and returns it as it is then. A running one stops at its
    /// next iteration.
    ///
    /// # Errors
    /// When there is no such job, or when the disk fails.
    pub fn cancel(&self, catalogue: &Catalogue, id: u64) -> Result<Arc<Job>, CatalogueError> {
        let mut had_ended = false;
        let job = catalogue.change_job(id, Vec::new(), |job| {
            had_ended = job.state.is_final();
            (!had_ended).then_some((JobState::Cancelled, job.attempts))
        })?;
        if !had_ended {
            self.listener.hear(&job, None);
        }
        self.tell(|board| board.stop(id));
        Ok(job)
    }

    /// Wakes up whenever a job may have changed.
    pub fn news(&self) -> watch::Receiver<Board> {
        self.board.subscribe()
    }

    /// Makes the worker put its job back into the queue and end.
    pub fn stop(&self) {
        self.tell(Board::stop_all);
    }

    fn tell(&self, change: impl FnOnce(&mut Board)) {
        self.board.send_modify(change);
    }
}

#[cfg(test)]
mod tests;
