//! The commands: arguments in, tables or JSON out, errors as one line.
//!
//! Standard output holds results only; progress and logs go to standard error.

#[cfg(feature = "fit")]
mod certify;
#[cfg(feature = "fit")]
mod demo;
#[cfg(feature = "fit")]
mod fit;
#[cfg(feature = "fit")]
mod group;
mod measure;
#[cfg(feature = "fit")]
mod mesh;
mod push;
mod serve;
mod show;
mod sos_body;
mod verify;

use crate::body::{Obstacle, Shape};
use clap::Parser;
use std::error::Error;
use std::io;
use std::path::Path;
use std::process::ExitCode;

/// What a command returns: whether what it was asked to check holds, or the error to print.
pub type Outcome = Result<bool, Box<dyn Error>>;

/// Real-time collision and proximity queries on certified convex polynomial bodies
///
/// Objects are stored as sets {x : p(x) <= 1} of sos-convex polynomials, fitted offline around
/// meshes and proven to contain them. Every answer is a bracket that is proven to hold the truth.
///
#[cfg_attr(
    feature = "fit",
    doc = "A first tour: 'sublevel demo'. With meshes of your own: 'fit', then 'measure' without a server, or 'serve' and 'push'."
)]
#[cfg_attr(not(feature = "fit"), doc = "Built without the feature 'fit': 'fit', 'certify' and 'demo' are left out.")]
#[derive(Debug, Parser)]
#[command(version, max_term_width = 100)]
enum Command {
    #[cfg(feature = "fit")]
    Demo(demo::DemoArgs),
    #[cfg(feature = "fit")]
    Fit(fit::FitArgs),
    Show(show::ShowArgs),
    Verify(verify::VerifyArgs),
    #[cfg(feature = "fit")]
    Certify(certify::CertifyArgs),
    Measure(measure::MeasureArgs),
    Serve(serve::ServeArgs),
    Push(push::PushArgs),
}

/// Runs the command line of this process. Exit code 0: done; 1: failed, with one line on standard
/// error, or a checked claim does not hold; 2: the arguments are wrong.
pub fn main() -> ExitCode {
    let done = |()| true;
    let outcome: Outcome = match Command::parse() {
        #[cfg(feature = "fit")]
        Command::Demo(args) => demo::run(&args).map(done).map_err(Into::into),
        #[cfg(feature = "fit")]
        Command::Fit(args) => fit::run(&args).map(done),
        Command::Show(args) => show::run(&args).map(done),
        Command::Verify(args) => verify::run(&args),
        #[cfg(feature = "fit")]
        Command::Certify(args) => certify::run(&args).map(done),
        Command::Measure(args) => measure::run(&args).map(done),
        Command::Serve(args) => serve::run(&args).map(done).map_err(Into::into),
        Command::Push(args) => push::run(&args).map(done),
    };
    exit_code(outcome)
}

/// The exit code of what a command returned, its error printed in one line on standard error.
pub fn exit_code(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        // Whoever reads our output went away; nobody is left to tell.
        Err(error) if is_broken_pipe(error.as_ref()) => ExitCode::FAILURE,
        Err(error) => {
            // Nothing but standard output gives a bare system error: files are named.
            let place = if error.is::<io::Error>() { "cannot write the output: " } else { "" };
            eprintln!("error: {place}{}", one_line(&error.to_string()));
            ExitCode::FAILURE
        }
    }
}

fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    let mut cause = Some(error);
    while let Some(error) = cause {
        let plain = error.downcast_ref::<io::Error>().map(io::Error::kind);
        let in_json = error.downcast_ref::<serde_json::Error>().and_then(serde_json::Error::io_error_kind);
        if plain.or(in_json) == Some(io::ErrorKind::BrokenPipe) {
            return true;
        }
        cause = error.source();
    }
    false
}

/// One printable line of at most about a thousand characters: messages quote input, which may hold
/// anything.
fn one_line(text: &str) -> String {
    const LONGEST: usize = 1000;
    let mut line: String = text
        .chars()
        .take(LONGEST)
        .flat_map(|c| if c.is_control() { c.escape_default().collect() } else { vec![c] })
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        line.push_str(" ...");
    }
    line
}

/// Reads a text file.
///
/// # Errors
/// What the system said, with the file's name and the remedy.
pub fn read(path: &Path) -> Result<String, Box<dyn Error>> {
    std::fs::read_to_string(path).map_err(|error| format!("{}: {error}; check the path", path.display()).into())
}

/// Reads and re-proves the file of a body or an sos-body, naming it in the error.
fn read_obstacle(path: &Path) -> Result<Obstacle, Box<dyn Error>> {
    Obstacle::from_json(&read(path)?).map_err(|error| format!("{}: {error}", path.display()).into())
}

/// Reads and re-proves the file of a body or a compound, naming it in the error.
fn read_shape(path: &Path) -> Result<Shape, Box<dyn Error>> {
    Shape::from_json(&read(path)?).map_err(|error| format!("{}: {error}", path.display()).into())
}

/// Writes a file whole or not at all: under a temporary name beside it, then renamed.
///
/// # Errors
/// What the system said, with the file's name and the remedy.
pub fn write_atomically(path: &Path, content: &str) -> Result<(), Box<dyn Error>> {
    use std::io::Write;
    let failed =
        |error: std::io::Error| format!("cannot write {}: {error}; check the folder and its space", path.display());
    let mut name = path.file_name().ok_or_else(|| format!("{} names no file", path.display()))?.to_owned();
    name.push(format!(".{}.tmp", std::process::id()));
    let temporary = path.with_file_name(name);
    let written = std::fs::File::create(&temporary)
        .and_then(|mut file| file.write_all(content.as_bytes()).and_then(|()| file.sync_all()))
        .and_then(|()| std::fs::rename(&temporary, path));
    if let Err(error) = written {
        // What is left of the attempt only takes space.
        let _ = std::fs::remove_file(&temporary);
        return Err(failed(error).into());
    }
    Ok(())
}
