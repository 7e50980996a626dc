//! `sublevel demo`.

use crate::demo::{self, DemoError};
use std::io;
use std::path::PathBuf;

/// Run the whole job on shapes made here: fit a chair and a human, serve them, sweep one through
/// the other
///
/// Prints the table of fits and the level-distance curve; writes meshes, body files, the numbers as
/// CSV and the plots as SVG. Needs no input, and takes a few seconds.
#[derive(Debug, clap::Args)]
pub(super) struct DemoArgs {
    /// Folder for everything the demo writes; made when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-demo")]
    pub(super) out: PathBuf,
}

/// Runs the demo and prints its tables to standard output.
///
/// # Errors
/// The first step that fails, and why.
pub(super) fn run(args: &DemoArgs) -> Result<(), DemoError> {
    demo::run(&args.out, &mut io::stdout().lock())
}
