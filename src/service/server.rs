//! Starting, announcing, draining.

use std::future::Future;
use std::io::{self, Write};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use tokio::net::TcpListener;
use tokio::signal::unix::{Signal, SignalKind, signal};
use tokio::sync::{oneshot, watch};
use tonic::transport::server::Router;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;
use tower::layer::util::{Identity, Stack};

#[cfg(feature = "fit")]
use crate::jobs::Jobs;
use crate::store::{Catalogue, Counts, FORK_IDLE, Store, StoreError};

use super::admin::{self, Admin};
use super::app_state::AppState;
use super::authorization::Authorization;
use super::blob_calls::BlobCalls;
use super::bodies::Bodies;
use super::call_layer::CallLayer;
use super::concurrency_limit::ConcurrencyLimit;
use super::config::{Config, ConfigError};
#[cfg(feature = "fit")]
use super::fits::Fits;
#[cfg(feature = "fit")]
use super::hierarchy::HierarchyCalls;
use super::incoming::Incoming;
#[cfg(feature = "fit")]
use super::jobs::JobCalls;
use super::limits::{MAX_HEADER_BYTES, MAX_RESET_STREAMS, POSES_WRITTEN_EVERY, PROVER_NICE, WINDOW_BYTES};
#[cfg(feature = "fit")]
use super::link_fits::LinkFits;
use super::metrics::Metrics;
use super::proto::FILE_DESCRIPTOR_SET;
use super::proto::blob_service_server::{self, BlobServiceServer};
use super::proto::body_service_server::{self, BodyServiceServer};
#[cfg(feature = "fit")]
use super::proto::fit_service_server::{self, FitServiceServer};
#[cfg(feature = "fit")]
use super::proto::hierarchy_service_server::{self, HierarchyServiceServer};
#[cfg(feature = "fit")]
use super::proto::job_service_server::{self, JobServiceServer};
use super::proto::query_service_server::{self, QueryServiceServer};
use super::proto::robot_service_server::{self, RobotServiceServer};
use super::proto::scene_service_server::{self, SceneServiceServer};
use super::proto::server_service_server::{self, ServerServiceServer};
use super::queries::Queries;
use super::robots::Robots;
use super::scenes::Scenes;
use super::server_info::ServerInfo;
use super::tls::{self, TlsError};
use super::tokens::{self, Tokens, TokensError};

/// Why a server could not start or ended before it was reported to.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The settings do not go together.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Certificates that cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// Tokens that cannot be used.
    #[error(transparent)]
    Tokens(#[from] TokensError),
    /// The address cannot be listened on.
    #[error("cannot listen on {addr}: {source}; choose another address, or port 0 for any free port")]
    Bind {
        /// The address.
        addr: SocketAddr,
        /// What the system said.
        source: io::Error,
    },
    /// The catalogue cannot be opened or loaded.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A task of the server panicked.
    #[error("loading the catalogue was ended by a panic: {0}; please report it")]
    InternalPanic(String),
    /// The transport gave up.
    #[error("serving ended: {0}")]
    Transport(#[from] tonic::transport::Error),
    /// Signals cannot be listened for, or standard output is closed.
    #[error("cannot set the server up: {0}")]
    Setup(#[from] io::Error),
}

/// A server that listens and holds the lock of its catalogue, but does not answer yet.
#[derive(Debug)]
pub struct Server {
    config: Config,
    listener: TcpListener,
    addr: SocketAddr,
    admin: Option<TcpListener>,
    tls: Option<tls::Current>,
    tokens: Option<watch::Receiver<Arc<Tokens>>>,
    store: Store,
}

impl Server {
    /// Binds the addresses, reads certificates and tokens, and locks the catalogue. Connections
    /// queue until [`Server::run`].
    ///
    /// # Errors
    /// Settings that do not go together, files that cannot be used, an address that is taken, and a
    /// catalogue that is in use or cannot be opened.
    pub async fn bind(config: Config) -> Result<Self, ServeError> {
        config.check()?;
        config.simd.apply();
        let tls = config.tls.clone().map(tls::certificates).transpose()?;
        let tokens = config.tokens.clone().map(tokens::tokens).transpose()?;
        let (listener, addr) = bind(config.listen).await?;
        let admin = match config.admin {
            Some(addr) => {
                let (listener, addr) = bind(addr).await?;
                if addr.ip().is_loopback() {
                    tracing::info!(%addr, "probes and metrics");
                } else {
                    tracing::warn!(%addr, "probes and metrics, for everybody who reaches this address");
                }
                Some(listener)
            }
            None => None,
        };
        let data = config.data.clone();
        let store = tokio::task::spawn_blocking(move || Store::open(&data))
            .await
            .map_err(|error| ServeError::InternalPanic(error.to_string()))??;
        Ok(Self { config, listener, addr, admin, tls, tokens, store })
    }

    /// Where it listens; the port that was found when port 0 was asked for.
    pub fn local_addr(&self) -> SocketAddr {
        self.addr
    }

    /// Serves until `stop` resolves, then lets open calls finish for a while. Health says
    /// NOT_SERVING until the catalogue is loaded and from `stop` on.
    ///
    /// # Errors
    /// When the catalogue cannot be loaded or the transport gives up.
    pub async fn run(self, stop: impl Future<Output = ()> + Send) -> Result<(), ServeError> {
        let (loaded, catalogue) = watch::channel(None);
        let (health, health_service) = tonic_health::server::health_reporter();
        // It starts as SERVING.
        set_health(&health, ServingStatus::NotServing).await;
        let (stop_streams, stopping) = watch::channel(false);
        let (limits, metrics) = (self.config.limits, Metrics::default());
        let app = AppState::new(catalogue.clone(), stopping.clone(), (limits.clone(), metrics.clone()))?;
        let calls = CallLayer::new(Authorization(self.tokens), metrics.clone());
        #[cfg(feature = "fit")]
        let jobs = {
            let metrics = metrics.clone();
            Jobs::heard_by(move |job, took| metrics.job_ended(job, took))
        };
        let robots = Robots {
            app: app.clone(),
            #[cfg(feature = "fit")]
            jobs: jobs.clone(),
            #[cfg(feature = "fit")]
            fits: LinkFits::default(),
        };
        let router = router(&app, robots, calls).add_service(health_service);
        let admin = self.admin.map(|listener| {
            let looked_at = Admin { metrics: metrics.clone(), catalogue: catalogue.clone(), stopping };
            tokio::spawn(admin::serve(listener, looked_at))
        });
        let keeper = tokio::spawn(keep_scenes(catalogue.clone()));
        #[cfg(feature = "fit")]
        let (router, worker) = {
            let worker = tokio::spawn(jobs.clone().work(catalogue.clone()));
            (with_jobs(router, &app, &jobs), worker)
        };

        let stop_proving = Arc::<AtomicBool>::default();
        let loading = load(self.store, loaded, health.clone(), stop_proving.clone());
        let (failed, failure) = oneshot::channel();
        let loader = tokio::spawn(async move {
            if let Err(error) = loading.await {
                let _ = failed.send(error);
            }
        });

        let incoming = Incoming::new(self.listener, limits.connections, self.tls, metrics);
        let (draining, drain) = oneshot::channel();
        let serving = router.serve_with_incoming_shutdown(incoming, async {
            let _ = drain.await;
        });
        tokio::pin!(serving);
        let ended = tokio::select! {
            result = &mut serving => return Ok(result?),
            () = stop => Ok(()),
            Ok(error) = failure => Err(error),
        };
        loader.abort();
        stop_proving.store(true, Ordering::Relaxed);
        set_health(&health, ServingStatus::NotServing).await;
        let _ = draining.send(());
        stop_streams.send_replace(true);
        // The running job goes back into the queue, and those who watch it are reported.
        #[cfg(feature = "fit")]
        let serving = async {
            jobs.stop();
            let _ = worker.await;
            serving.await
        };
        // Streams may stay open as long as their clients like; waiting for them ends here.
        let drain = limits.drain();
        if let Ok(result) = tokio::time::timeout(drain, serving).await {
            result?;
        } else {
            tracing::warn!("some connections were still open after {drain:?} and are cut");
        }
        keeper.abort();
        if let Some(admin) = admin {
            admin.abort();
        }
        write_poses(&catalogue, true).await;
        ended
    }
}

/// Runs a server until SIGTERM or Ctrl-C, which it obeys with an orderly stop; a second one cuts it
/// short. Prints `listening on ADDR` as the first line on standard output when clients may connect.
///
/// # Errors
/// See [`Server::bind`] and [`Server::run`].
pub async fn serve(config: Config) -> Result<(), ServeError> {
    // Both before the first line on standard output: who has read it may send a signal.
    let mut signals = Signals::new()?;
    // What a relative path means is not in the log otherwise.
    let data = std::path::absolute(&config.data)?;
    let server = Server::bind(config).await?;
    let mut stdout = io::stdout();
    writeln!(stdout, "listening on {}", server.local_addr())?;
    stdout.flush()?;
    tracing::info!(addr = %server.local_addr(), data = %data.display(), "started");

    let (stopping, stop) = oneshot::channel();
    let running = server.run(async {
        let _ = stop.await;
    });
    tokio::pin!(running);
    tokio::select! {
        result = &mut running => return result,
        name = signals.next() => tracing::info!("{name}: stopping"),
    }
    let _ = stopping.send(());
    tokio::select! {
        result = running => result?,
        name = signals.next() => tracing::warn!("{name} again: open connections are cut"),
    }
    tracing::info!("stopped");
    Ok(())
}

/// The two signals that ask for a stop, caught from the moment this is made.
struct Signals {
    terminate: Signal,
    interrupt: Signal,
}

impl Signals {
    fn new() -> io::Result<Self> {
        Ok(Self { terminate: signal(SignalKind::terminate())?, interrupt: signal(SignalKind::interrupt())? })
    }

    async fn next(&mut self) -> &'static str {
        tokio::select! {
            _ = self.terminate.recv() => "SIGTERM",
            _ = self.interrupt.recv() => "Ctrl-C",
        }
    }
}

/// The services behind what every call passes first.
type Routes = Router<Stack<CallLayer, Identity>>;

async fn bind(addr: SocketAddr) -> Result<(TcpListener, SocketAddr), ServeError> {
    let failed = |source| ServeError::Bind { addr, source };
    let listener = TcpListener::bind(addr).await.map_err(failed)?;
    let addr = listener.local_addr().map_err(failed)?;
    Ok((listener, addr))
}

fn router(app: &AppState, robots: Robots, calls: CallLayer) -> Routes {
    let reflection = || {
        tonic_reflection::server::Builder::configure()
            .register_encoded_file_descriptor_set(FILE_DESCRIPTOR_SET)
            .register_encoded_file_descriptor_set(tonic_health::pb::FILE_DESCRIPTOR_SET)
    };
    let limits = app.limits();
    // Messages are measured before tonic reads them, see `message_limit`; answers by the handlers.
    let (sized, limit) = (usize::MAX, ConcurrencyLimit::new(limits, app.metrics().clone()));
    let bodies = BodyServiceServer::new(Bodies(app.clone()));
    let blobs = BlobServiceServer::new(BlobCalls(app.clone()));
    let robots = RobotServiceServer::new(robots);
    let scenes = SceneServiceServer::new(Scenes(app.clone()));
    let queries = QueryServiceServer::new(Queries(app.clone()));
    let [keepalive, keepalive_timeout] = limits.keepalive();
    let mut server = tonic::transport::Server::builder();
    if let Some(age) = limits.connection_age() {
        server = server.max_connection_age(age).max_connection_age_grace(limits.drain());
    }
    server
        .layer(calls)
        .max_concurrent_streams(limits.calls_per_connection)
        .http2_max_pending_accept_reset_streams(Some(MAX_RESET_STREAMS))
        .http2_max_header_list_size(MAX_HEADER_BYTES)
        .initial_stream_window_size(WINDOW_BYTES[0])
        .initial_connection_window_size(WINDOW_BYTES[1])
        .http2_keepalive_interval(Some(keepalive))
        .http2_keepalive_timeout(Some(keepalive_timeout))
        .add_service(ServerServiceServer::new(ServerInfo(app.clone())))
        .add_service(limit.before(bodies.max_decoding_message_size(sized).max_encoding_message_size(sized)))
        .add_service(limit.before(blobs.max_decoding_message_size(sized).max_encoding_message_size(sized)))
        .add_service(limit.before(robots.max_decoding_message_size(sized).max_encoding_message_size(sized)))
        .add_service(limit.before(scenes.max_decoding_message_size(sized).max_encoding_message_size(sized)))
        .add_service(limit.before(queries.max_decoding_message_size(sized).max_encoding_message_size(sized)))
        // Older clients know v1alpha only. The descriptors are compiled in, so they are read or a
        // test fails.
        .add_optional_service(reflection().build_v1().ok())
        .add_optional_service(reflection().build_v1alpha().ok())
}

/// Jobs behind a limit of their own: meshes of fits take long to read, and nothing else waits for
/// them.
#[cfg(feature = "fit")]
fn with_jobs(router: Routes, app: &AppState, jobs: &Jobs) -> Routes {
    let fits = FitServiceServer::new(Fits::new(app.clone(), jobs.clone()));
    let solves = HierarchyServiceServer::new(HierarchyCalls { app: app.clone(), jobs: jobs.clone() });
    let calls = JobServiceServer::new(JobCalls { app: app.clone(), jobs: jobs.clone() });
    let (sized, limit) = (usize::MAX, ConcurrencyLimit::new(app.limits(), app.metrics().clone()));
    router
        .add_service(limit.before(fits.max_decoding_message_size(sized).max_encoding_message_size(sized)))
        .add_service(limit.before(solves.max_decoding_message_size(sized).max_encoding_message_size(sized)))
        .add_service(limit.before(calls.max_decoding_message_size(sized).max_encoding_message_size(sized)))
}

/// Writes streamed poses and removes forks that are idle, until it is ended.
async fn keep_scenes(catalogue: watch::Receiver<Option<Arc<Catalogue>>>) {
    loop {
        tokio::time::sleep(POSES_WRITTEN_EVERY).await;
        write_poses(&catalogue, false).await;
        if let Some(catalogue) = catalogue.borrow().clone() {
            catalogue.expire_forks(FORK_IDLE);
        }
    }
}

async fn write_poses(catalogue: &watch::Receiver<Option<Arc<Catalogue>>>, last: bool) {
    let Some(catalogue) = catalogue.borrow().clone() else { return };
    match tokio::task::spawn_blocking(move || catalogue.write_poses(last)).await {
        Ok(Ok(_)) => {}
        Ok(Err(error)) => tracing::error!(%error, "streamed poses could not be written; they are tried again"),
        Err(error) => tracing::error!(%error, "writing streamed poses was ended by a panic"),
    }
}

/// Loads the catalogue on a thread that may block, then opens the doors; its bodies are proven
/// behind them, until `stop`.
async fn load(
    store: Store,
    loaded: watch::Sender<Option<Arc<Catalogue>>>,
    health: HealthReporter,
    stop: Arc<AtomicBool>,
) -> Result<(), ServeError> {
    let catalogue = tokio::task::spawn_blocking(move || Catalogue::load(store))
        .await
        .map_err(|error| ServeError::InternalPanic(error.to_string()))??;
    let Counts { bodies, scenes, .. } = catalogue.counts();
    tracing::info!(bodies, scenes, "catalogue loaded");
    let catalogue = Arc::new(catalogue);
    loaded.send_replace(Some(catalogue.clone()));
    set_health(&health, ServingStatus::Serving).await;
    std::thread::Builder::new().name("prover".into()).spawn(move || prove(&catalogue, &stop))?;
    Ok(())
}

/// Proves what was loaded, on threads that leave the cores to those who answer.
fn prove(catalogue: &Catalogue, stop: &AtomicBool) {
    if catalogue.is_proven() {
        return;
    }
    // Of this thread and those that it starts. Without that it only disturbs more.
    let _ = rustix::process::nice(PROVER_NICE);
    let begun = Instant::now();
    if catalogue.prove_all(stop) {
        let Counts { bodies, damaged_bodies, .. } = catalogue.counts();
        let seconds = begun.elapsed().as_secs_f64();
        tracing::info!(bodies, damaged_bodies, seconds, "all bodies are proven but those that are damaged");
    }
}

async fn set_health(health: &HealthReporter, status: ServingStatus) {
    let services = [
        "",
        blob_service_server::SERVICE_NAME,
        body_service_server::SERVICE_NAME,
        query_service_server::SERVICE_NAME,
        robot_service_server::SERVICE_NAME,
        scene_service_server::SERVICE_NAME,
        server_service_server::SERVICE_NAME,
    ];
    #[cfg(feature = "fit")]
    let services = services.into_iter().chain([
        fit_service_server::SERVICE_NAME,
        hierarchy_service_server::SERVICE_NAME,
        job_service_server::SERVICE_NAME,
    ]);
    for service in services {
        health.set_service_status(service, status).await;
    }
}
