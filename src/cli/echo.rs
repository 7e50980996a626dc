//! `sublevel echo`, which `sublevel load` starts.

use std::error::Error;
use std::io::{self, Write};

use crate::load::echo;

/// Answer every question with as many bytes, until it is killed
#[derive(Debug, clap::Args)]
pub(super) struct EchoArgs {
    /// Bytes of an answer
    #[arg(long, value_name = "BYTES")]
    answer_bytes: usize,
}

/// Answers until it is killed.
///
/// # Errors
/// When there is no port for it.
pub(super) fn run(args: &EchoArgs) -> Result<(), Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(async {
        let echo = echo(args.answer_bytes).await?;
        let addr = echo.url().replace("http://", "");
        writeln!(io::stdout(), "listening on {addr}")?;
        std::future::pending().await
    })
}
