//! What every handler holds: the catalogue once it is loaded, and the gates to the threads that
//! work.

use std::sync::Arc;
use std::thread;

use tokio::sync::{Semaphore, watch};
use tonic::Status;

use crate::store::{Catalogue, CatalogueError};

use super::error;
use super::limits::LOADING_PATIENCE;

/// Shared by all handlers. Work that blocks passes a limit first, so that one kind of it cannot
/// take every thread.
#[derive(Debug, Clone)]
pub(super) struct AppState {
    catalogue: watch::Receiver<Option<Arc<Catalogue>>>,
    /// One share of a query per core; who waits is let in in turn.
    solving: Arc<Semaphore>,
    /// Half the cores at most re-prove new bodies, which takes long; queries go on beside it.
    proving: Arc<Semaphore>,
    /// Changes are made one after the other; they wait here rather than on a thread.
    changing: Arc<Semaphore>,
}

impl AppState {
    pub(super) fn new(catalogue: watch::Receiver<Option<Arc<Catalogue>>>) -> Self {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let limit = |permits| Arc::new(Semaphore::new(permits));
        Self { catalogue, solving: limit(cores), proving: limit(cores.div_ceil(2)), changing: limit(1) }
    }

    /// The catalogue; waits a little while it is loading, so that a client that starts along with
    /// the server works.
    pub(super) async fn catalogue(&self) -> Result<Arc<Catalogue>, Status> {
        if let Some(catalogue) = &*self.catalogue.borrow() {
            return Ok(catalogue.clone());
        }
        let mut loading = self.catalogue.clone();
        let loaded = tokio::time::timeout(LOADING_PATIENCE, loading.wait_for(Option::is_some)).await;
        match loaded {
            Ok(Ok(catalogue)) => catalogue.clone(),
            _ => None,
        }
        .ok_or_else(|| error::unavailable("LOADING", "the catalogue is loading; try again in a moment"))
    }

    /// Makes a change. Once begun it runs to its end, even when the client goes away meanwhile.
    /// `field` is where the request names what the change is about.
    pub(super) async fn change<T: Send + 'static>(
        &self,
        field: &'static str,
        change: impl FnOnce(&Catalogue) -> Result<T, CatalogueError> + Send + 'static,
    ) -> Result<T, Status> {
        let catalogue = self.catalogue().await?;
        on_thread(&self.changing, move || change(&catalogue)).await?.map_err(|error| error::catalogue(&error, field))
    }

    /// Answers a share of a query, or writes a large answer; keep it short, for others wait in
    /// turn.
    pub(super) async fn solve<T: Send + 'static>(
        &self,
        solve: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        on_thread(&self.solving, solve).await
    }

    /// Proves a new body.
    pub(super) async fn prove<T: Send + 'static>(
        &self,
        prove: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        on_thread(&self.proving, prove).await
    }
}

/// Runs work to its end on a thread that may block, as many at once as the limit lets in.
async fn on_thread<T: Send + 'static>(
    limit: &Arc<Semaphore>,
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, Status> {
    let permit = limit.clone().acquire_owned().await;
    tokio::task::spawn_blocking(move || {
        // Held until the end, also when the caller is gone.
        let _permit = permit;
        work()
    })
    .await
    .map_err(|error| error::internal_panic(&error))
}
