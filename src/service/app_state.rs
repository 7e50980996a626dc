//! What every handler has: the catalogue once it is loaded, and the gates to the threads that
//! work.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread;
use std::time::Instant;

use tokio::sync::{Semaphore, oneshot, watch};
use tonic::Status;

use crate::robot::counted;
use crate::scene::{Crew, Panicked, Question, Scene, Stop};
use crate::store::{Catalogue, CatalogueError, Counts, LiveScene};

use super::blobs::Blobs;
use super::body_mesh::Meshes;
use super::call_time::{CallTime, until};
use super::config::LimitsConfig;
use super::error;
use super::limits::{LOADING_PATIENCE, MAX_EXAMINING, SMALL_SCENE};
use super::metrics::Metrics;
use super::reason::Reason;
use super::wire;

/// Shared by all handlers. Work that blocks passes a limit first, so that one kind of it cannot
/// take every thread.
#[derive(Debug, Clone)]
pub(super) struct AppState {
    catalogue: watch::Receiver<Option<Arc<Catalogue>>>,
    limits: LimitsConfig,
    metrics: Metrics,
    /// Answers questions on all cores.
    crew: Arc<Crew>,
    /// Trees of scenes, and large answers, are made on one thread per core; who waits is let in in
    /// turn.
    solving: Arc<Semaphore>,
    stopping: watch::Receiver<bool>,
    blobs: Arc<Blobs>,
    meshes: Arc<Meshes>,
    /// Half the cores at most re-prove new bodies, which takes long; queries go on beside it.
    proving: Arc<Semaphore>,
    /// Calls that wait for bodies to be proven take a thread each.
    examining: Arc<Semaphore>,
    /// Backups are made one after the other: each takes as much space as the catalogue.
    backing_up: Arc<Semaphore>,
    /// Changes are made one after the other; they wait here rather than on a thread.
    changing: Arc<Semaphore>,
}

impl AppState {
    pub(super) fn new(
        catalogue: watch::Receiver<Option<Arc<Catalogue>>>,
        stopping: watch::Receiver<bool>,
        (limits, metrics): (LimitsConfig, Metrics),
    ) -> std::io::Result<Self> {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let limit = |permits| Arc::new(Semaphore::new(permits));
        Ok(Self {
            catalogue,
            crew: Arc::new(Crew::new(limits.threads())?),
            limits,
            metrics,
            solving: limit(cores),
            stopping,
            blobs: Arc::default(),
            meshes: Arc::default(),
            proving: limit(cores.div_ceil(2)),
            examining: limit(MAX_EXAMINING),
            backing_up: limit(1),
            changing: limit(1),
        })
    }

    /// Limits of connections and calls.
    pub(super) fn limits(&self) -> &LimitsConfig {
        &self.limits
    }

    /// What is counted.
    pub(super) fn metrics(&self) -> &Metrics {
        &self.metrics
    }

    /// Becomes true when the server stops.
    pub(super) fn stopping(&self) -> watch::Receiver<bool> {
        self.stopping.clone()
    }

    /// Files in pieces.
    pub(super) fn blobs(&self) -> &Blobs {
        &self.blobs
    }

    /// Meshes of bodies that were asked for.
    pub(super) fn meshes(&self) -> &Meshes {
        &self.meshes
    }

    /// Whether the catalogue is loaded.
    pub(super) fn is_loaded(&self) -> bool {
        self.catalogue.borrow().is_some()
    }

    /// The threads that answer questions.
    pub(super) fn crew(&self) -> Arc<Crew> {
        self.crew.clone()
    }

    /// Answers a question: a brief one here and whole, others on all cores. These end with what is
    /// known when the budget is over, and without an answer at the deadline or when the caller is
    /// gone.
    pub(super) async fn ask<Q: Question>(&self, question: Arc<Q>, time: CallTime) -> Result<Vec<Q::Part>, Status> {
        let stop = Arc::<Stop>::default();
        let now = Instant::now();
        let has_time = [time.deadline, time.budget].iter().flatten().all(|end| now < *end);
        if question.is_brief() && has_time {
            let solve = || (0..question.chunks()).map(|chunk| question.solve(chunk, &stop)).collect();
            return catch_unwind(AssertUnwindSafe(solve)).map_err(|_| error::abandoned());
        }
        let (sender, receiver) = oneshot::channel();
        self.crew.submit(question, stop.clone(), move |parts| {
            let _ = sender.send(parts);
        });
        let parts = ended(async { receiver.await.unwrap_or(Err(Panicked)) }, &stop, time).await?;
        parts.map_err(|_| error::abandoned())
    }

    /// Runs a search that asks several questions, one after the other, with the same limits of
    /// time.
    pub(super) async fn search<T: Send + 'static>(
        &self,
        search: impl FnOnce(&Arc<Stop>) -> T + Send + 'static,
        time: CallTime,
    ) -> Result<T, Status> {
        let stop = Arc::<Stop>::default();
        let flag = stop.clone();
        ended(on_thread(&self.solving, move || search(&flag)), &stop, time).await?
    }

    /// Prepares a question about a scene, such as by making its tree: at once for small scenes,
    /// else not on a thread that serves connections.
    pub(super) async fn prepare<T: Send + 'static>(
        &self,
        scene: &Scene,
        prepare: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        if scene.len() <= SMALL_SCENE { Ok(prepare()) } else { self.work(prepare).await }
    }

    /// Work of some milliseconds, such as drawing a mesh.
    pub(super) async fn work<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T, Status> {
        on_thread(&self.solving, work).await
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
        .ok_or_else(|| error::unavailable(Reason::Loading, "the catalogue is loading; try again in a moment"))
    }

    /// What the catalogue says; who asks for something that is not proven yet waits a little.
    pub(super) async fn look<T: Send + 'static>(
        &self,
        field: &'static str,
        look: impl FnOnce(&Catalogue) -> Result<T, CatalogueError> + Send + 'static,
    ) -> Result<T, Status> {
        let catalogue = self.catalogue().await?;
        let found = if catalogue.is_proven() { look(&catalogue) } else { self.proven(catalogue, look).await? };
        found.map_err(|error| error::catalogue(&error, field))
    }

    /// A scene or fork; who asks for one whose bodies are not proven yet waits a little. `field` is
    /// where the request names it.
    pub(super) async fn live_scene(&self, name: &str, field: &str) -> Result<Arc<LiveScene>, Status> {
        wire::name(name, field)?;
        let catalogue = self.catalogue().await?;
        let found = if catalogue.is_scene_proven(name) {
            catalogue.live_scene(name)
        } else {
            let name = name.to_owned();
            self.proven(catalogue, move |catalogue| catalogue.live_scene(&name)).await?
        };
        found.map_err(|error| error::catalogue(&error, field))
    }

    /// Looks at what is not proven yet, which takes from milliseconds to a minute; it goes on when
    /// nobody waits any more.
    async fn proven<T: Send + 'static>(
        &self,
        catalogue: Arc<Catalogue>,
        look: impl FnOnce(&Catalogue) -> T + Send + 'static,
    ) -> Result<T, Status> {
        let looking = catalogue.clone();
        let work = on_thread(&self.examining, move || look(&looking));
        match tokio::time::timeout(LOADING_PATIENCE, work).await {
            Ok(done) => done,
            Err(_) => {
                let Counts { bodies, unproven_bodies, .. } = catalogue.counts();
                let [one, many] = ["is", "are"].map(|verb| format!("of {bodies} bodies {verb}"));
                let unproven = counted(unproven_bodies, &one, &many);
                let why = format!("{unproven} still to be proven; try again in a moment");
                Err(error::unavailable(Reason::Loading, &why))
            }
        }
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

    /// Makes a backup.
    pub(super) async fn back_up<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        on_thread(&self.backing_up, work).await
    }

    /// Proves a new body.
    pub(super) async fn prove<T: Send + 'static>(
        &self,
        prove: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        on_thread(&self.proving, prove).await
    }

    /// The same with limits of time, and for callers that may leave.
    pub(super) async fn prove_within<T: Send + 'static>(
        &self,
        prove: impl FnOnce(&Arc<Stop>) -> T + Send + 'static,
        time: CallTime,
    ) -> Result<T, Status> {
        let stop = Arc::<Stop>::default();
        let flag = stop.clone();
        ended(on_thread(&self.proving, move || prove(&flag)), &stop, time).await?
    }
}

/// Waits until the server stops.
pub(super) async fn stopped(stopping: &mut watch::Receiver<bool>) {
    // A sender that is gone has stopped, too.
    let _ = stopping.wait_for(|stopping| *stopping).await;
}

/// Waits for work, stopping it when its time is over or the caller is gone.
async fn ended<T>(work: impl Future<Output = T>, stop: &Arc<Stop>, time: CallTime) -> Result<T, Status> {
    /// Abandons the work unless it came to its end.
    struct Guard(Option<Arc<Stop>>);
    impl Drop for Guard {
        fn drop(&mut self) {
            if let Some(stop) = self.0.take() {
                stop.abandon();
            }
        }
    }
    let mut guard = Guard(Some(stop.clone()));
    tokio::pin!(work);
    let mut budget = time.budget;
    loop {
        tokio::select! {
            biased;
            done = &mut work => {
                guard.0 = None;
                return Ok(done);
            }
            () = until(time.deadline) => return Err(error::deadline()),
            () = until(budget) => {
                stop.set();
                budget = None;
            }
        }
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
