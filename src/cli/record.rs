//! `sublevel record`.

use std::error::Error;
use std::fs::File;
use std::io::{self, Write};
use std::net::SocketAddr;
use std::path::PathBuf;

use crate::client::{ClientOptions, endpoint};
use crate::load::Recorder;
use crate::robot::counted;

/// Write down the questions that clients ask a server, for `sublevel load`
///
/// A proxy: clients call it instead of the server, and everything passes. The messages of
/// Evaluate, CheckStates, Clearance and CastRays are written to a file, one JSON object a line,
/// until Ctrl-C. `sublevel load FILE` asks them again, of a server with the same scenes. The proxy
/// does not encrypt what clients send to it, so it listens on loopback by default; their tokens are
/// passed on, and not written.
///
/// Example: sublevel record --server http://127.0.0.1:50051 --out calls.jsonl
#[derive(Debug, clap::Args)]
pub(super) struct RecordArgs {
    /// Address of the server
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:50051")]
    server: String,
    /// Address for the clients; port 0 takes any free port
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:50061")]
    listen: SocketAddr,
    /// File of the recording; must not be there yet
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Records until Ctrl-C or SIGTERM.
///
/// # Errors
/// A server that nobody answers at, an address that is taken, and a file that is there or cannot be
/// written.
pub(super) fn run(args: &RecordArgs) -> Result<(), Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(async {
        // Both before the first line: who has read it may send a signal.
        let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
        let mut interrupt = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::interrupt())?;
        let server = endpoint(&args.server, &ClientOptions::from_environment())?.connect_lazy();
        let file = File::create_new(&args.out)
            .map_err(|error| format!("cannot make {}: {error}; choose another --out", args.out.display()))?;
        let taken = |error| format!("cannot listen on {}: {error}; choose another --listen", args.listen);
        let recorder = Recorder::new(args.listen, server, file).await.map_err(taken)?;
        writeln!(io::stdout(), "listening on {}", recorder.local_addr()?)?;
        let stop = async {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
        };
        let calls = recorder.run(stop).await?;
        writeln!(io::stderr(), "{}: {}", args.out.display(), counted(calls, "call", "calls"))?;
        Ok(())
    })
}
