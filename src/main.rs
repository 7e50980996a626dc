//! The `sublevel` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    sublevel::cli::main()
}
