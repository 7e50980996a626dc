//! `sublevel health`.

use std::error::Error;
use std::io::{self, Write};
use std::time::Duration;

use crate::client::{Client, ClientOptions};

/// Ask a server whether it answers calls: a probe
///
/// Exits with 0 when it does, with 1 when it is loading, stopping or not there.
///
/// Example: sublevel health --server http://127.0.0.1:50051
#[derive(Debug, clap::Args)]
pub(super) struct HealthArgs {
    /// Address of the server
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:50051")]
    server: String,
    /// Longest time to wait for the answer, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0)]
    timeout: f64,
}

/// Prints the state of the server; whether it serves.
///
/// # Errors
/// When nobody answers.
pub(super) fn run(args: &HealthArgs) -> Result<bool, Box<dyn Error>> {
    let patience = Duration::try_from_secs_f64(args.timeout)
        .ok()
        .filter(|patience| !patience.is_zero())
        .ok_or_else(|| format!("--timeout {}: give seconds above 0", args.timeout))?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let state = runtime.block_on(async {
        let options = ClientOptions { patience, ..ClientOptions::from_environment() };
        Client::connect_with(&args.server, &options).await?.health().await
    })?;
    writeln!(io::stdout().lock(), "{}", if state { "SERVING" } else { "NOT_SERVING" })?;
    Ok(state)
}
