//! `sublevel echo`, which `sublevel load` starts.

use std::error::Error;
use std::io::{self, Write};

use rustix::thread::{CpuSet, sched_setaffinity};

use crate::load::echo;

/// Answer every question with as many bytes, until standard input ends
#[derive(Debug, clap::Args)]
pub(super) struct EchoArgs {
    /// Bytes of an answer
    #[arg(long, value_name = "BYTES")]
    answer_bytes: usize,
    /// Encrypt, with a new key; its certificate is printed after the address
    #[arg(long)]
    encrypted: bool,
    /// Core to run on
    #[arg(long, value_name = "CORE")]
    core: Option<usize>,
}

/// Answers until standard input ends.
///
/// # Errors
/// When there is no such core, or no port for it.
pub(super) fn run(args: &EchoArgs) -> Result<(), Box<dyn Error>> {
    if let Some(core) = args.core {
        if core >= CpuSet::MAX_CPU {
            return Err(format!("--core {core}: give 0 to {}", CpuSet::MAX_CPU - 1).into());
        }
        let mut cores = CpuSet::new();
        cores.set(core);
        // Of this thread, before there are others.
        sched_setaffinity(None, &cores).map_err(|error| format!("--core {core}: {error}"))?;
    }
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    runtime.block_on(async {
        let echo = echo(args.answer_bytes, args.encrypted).await?;
        writeln!(io::stdout(), "listening on {}", echo.addr())?;
        write!(io::stdout(), "{}", echo.certificate().unwrap_or_default())?;
        tokio::task::spawn_blocking(|| io::copy(&mut io::stdin(), &mut io::sink())).await??;
        Ok(())
    })
}
