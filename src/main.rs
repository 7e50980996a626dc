//! The `sublevel` command.

use std::process::ExitCode;

use clap::Parser;
use sublevel::cli::{push, serve};

#[derive(Parser)]
#[command(version)]
enum Command {
    Serve(serve::ServeArgs),
    Push(push::PushArgs),
}

fn main() -> ExitCode {
    let result = match Command::parse() {
        Command::Serve(args) => serve::run(&args).map_err(Into::into),
        Command::Push(args) => push::run(&args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
