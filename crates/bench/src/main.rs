//! The command line of the measurements: `cargo run --release -p sublevel-bench -- --help`.

use std::process::ExitCode;

fn main() -> ExitCode {
    sublevel_bench::figures::main()
}
