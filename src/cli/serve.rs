//! `sublevel serve`.

use std::net::SocketAddr;
use std::path::PathBuf;

use crate::service::{self, ServeError, ServeOptions};

/// Run the gRPC server: bodies, scenes and fit jobs on disk, distances on request
///
/// Prints 'listening on ADDR' as its first line on standard output; logs go to standard error, as
/// much as RUST_LOG says (error, warn, info, debug; default info). Changes are on disk before they
/// are acknowledged. SIGTERM or Ctrl-C stops it: calls in flight get a few seconds to end, and a
/// fit under way goes on at the next start.
///
/// Example: sublevel serve --data /var/lib/sublevel --listen 127.0.0.1:50051
#[derive(Debug, clap::Args)]
pub(super) struct ServeArgs {
    /// Address to listen on; loopback only until there is TLS. Port 0 takes any free port
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:50051")]
    pub(super) listen: SocketAddr,
    /// Directory that keeps bodies and scenes; made when it is not there. One server at a time
    #[arg(long, value_name = "DIR", default_value = "sublevel-data")]
    pub(super) data: PathBuf,
}

/// Serves until SIGTERM or Ctrl-C. Prints `listening on ADDR` first; logs go to standard error, as
/// much as the environment variable `RUST_LOG` says (default `info`).
///
/// # Errors
/// Why the server could not start, or ended by itself.
pub(super) fn run(args: &ServeArgs) -> Result<(), ServeError> {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    // A second subscriber in one process is no reason not to serve.
    let _ = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).with_ansi(false).try_init();
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let result = runtime.block_on(service::serve(ServeOptions { listen: args.listen, data: args.data.clone() }));
    // Calls that outlived the drain are not waited for again; whatever they had not committed was
    // not acknowledged.
    runtime.shutdown_timeout(std::time::Duration::from_secs(1));
    result
}
