//! `sublevel serve`.

use std::error::Error;
use std::io::{self, Write};
use std::net::SocketAddr;
use std::path::PathBuf;

use tracing_subscriber::Layer;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::layer::SubscriberExt;
use tracing_subscriber::util::SubscriberInitExt;

use crate::service::config::{Config, Flags, LogConfig, LogFormat, TlsFlags};
use crate::service::{self, ServeError};

/// Run the gRPC server: bodies, scenes and fit jobs on disk, distances on request
///
/// Prints 'listening on ADDR' as its first line on standard output; logs go to standard error.
/// Changes are on disk before they are acknowledged. SIGTERM or Ctrl-C stops it: calls in flight
/// get a few seconds to end, and a fit under way goes on at the next start.
///
/// Every setting has a default, which a TOML file (--config), the environment
/// (SUBLEVEL_SERVER_LISTEN, SUBLEVEL_SERVER_LIMITS__CALLS; RUST_LOG for log.filter, SUBLEVEL_SIMD
/// for simd) and flags change, in this order. --print-config prints what they come to.
///
/// Examples:
///   sublevel serve --data /var/lib/sublevel --listen 127.0.0.1:50051
///   sublevel serve --config /etc/sublevel.toml --print-config
///   sublevel serve --listen 0.0.0.0:50051 --tls-certificate server.pem --tls-key server.key --tokens tokens.toml
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct ServeArgs {
    /// File of settings, TOML
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Print all settings as TOML, and do not serve
    #[arg(long)]
    print_config: bool,
    /// Address to listen on [default: 127.0.0.1:50051]; port 0 takes any free port. One that others
    /// can reach needs certificates and tokens
    #[arg(long, value_name = "ADDR")]
    listen: Option<SocketAddr>,
    /// Directory that keeps bodies and scenes [default: sublevel-data]; made when it is not there.
    /// One server at a time
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Address for probes and metrics: /livez, /readyz, /metrics [default: none]
    #[arg(long, value_name = "ADDR")]
    admin: Option<SocketAddr>,
    /// File with the tokens that clients may show, see 'sublevel token' [default: no tokens
    /// needed]. Read again when it changes
    #[arg(long, value_name = "FILE")]
    tokens: Option<PathBuf>,
    /// The server's certificate and those between it and its root, PEM. Read again when it changes
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_certificate: Option<PathBuf>,
    /// Its private key, PEM
    #[arg(long, value_name = "FILE", requires = "tls_certificate")]
    tls_key: Option<PathBuf>,
    /// Roots of the certificates that clients have to show, PEM [default: clients need none]
    #[arg(long, value_name = "FILE", requires = "tls_certificate")]
    tls_client_ca: Option<PathBuf>,
    /// Lists of those that are revoked (CRL), PEM [default: none is]
    #[arg(long, value_name = "FILE", requires = "tls_client_ca")]
    tls_client_crl: Option<PathBuf>,
    /// Listen where others can reach it without certificates or tokens: everybody may do everything
    #[arg(long)]
    insecure: bool,
}

impl ServeArgs {
    fn flags(&self) -> Flags {
        let tls = TlsFlags {
            certificate: self.tls_certificate.clone(),
            key: self.tls_key.clone(),
            client_ca: self.tls_client_ca.clone(),
            client_crl: self.tls_client_crl.clone(),
        };
        Flags {
            listen: self.listen,
            data: self.data.clone(),
            insecure: self.insecure.then_some(true),
            admin: self.admin,
            tokens: self.tokens.clone(),
            tls,
        }
    }
}

/// Serves until SIGTERM or Ctrl-C. Prints `listening on ADDR` first; logs go to standard error.
///
/// # Errors
/// Settings that cannot be used, why the server could not start, or why it ended by itself.
pub(super) fn run(args: &ServeArgs) -> Result<(), Box<dyn Error>> {
    let config = Config::load(args.config.as_deref(), &args.flags())?;
    if args.print_config {
        return Ok(io::stdout().lock().write_all(config.to_toml().as_bytes())?);
    }
    begin_log(&config.log)?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let result = runtime.block_on(service::serve(config));
    // Calls that outlived the drain are not waited for again; whatever they had not committed was
    // not acknowledged.
    runtime.shutdown_timeout(std::time::Duration::from_secs(1));
    Ok(result.map_err(|error: ServeError| error)?)
}

fn begin_log(log: &LogConfig) -> Result<(), Box<dyn Error>> {
    let filter = log
        .filter
        .parse::<Targets>()
        .map_err(|error| format!("log.filter is \"{}\": {error}; write error, warn, info or debug", log.filter))?;
    let to_stderr = tracing_subscriber::fmt::layer().with_writer(io::stderr).with_ansi(false);
    // A second subscriber in one process is no reason not to serve.
    let _ = match log.format {
        LogFormat::Text => tracing_subscriber::registry().with(to_stderr.with_filter(filter)).try_init(),
        LogFormat::Json => tracing_subscriber::registry().with(to_stderr.json().with_filter(filter)).try_init(),
    };
    Ok(())
}
