//! `sublevel fit`.

pub(super) mod args;
mod choice;
pub(super) mod length;
mod reading_row;
pub(super) mod remote;
mod report;
pub(super) mod request;
mod sos;

use super::files::make_folder;
use super::mesh::note;
use super::progress::progress_bar;
use crate::fit::Progress;
use crate::jobs::fit_mesh;
use crate::store::FitRequest;
use args::FitArgs;
use indicatif::ProgressBar;
use reading_row::ReadingRow;
use remote::execute as execute_on;
use report::{InputMesh, Row};
use request::checked;
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Fits every input in turn; what was fitted before an error stays.
pub(super) fn run(args: &FitArgs) -> Result<(), Box<dyn Error>> {
    if let Some(name) = &args.group {
        return super::group::run(args, name);
    }
    let stems = args.inputs.iter().map(|input| stem(input)).collect::<Result<Vec<_>, _>>()?;
    for (i, stem) in stems.iter().enumerate() {
        if let Some(j) = stems[..i].iter().position(|earlier| earlier == stem) {
            let (first, second) = (args.inputs[j].display(), args.inputs[i].display());
            return Err(format!(
                "{first} and {second} would both become {stem}-*.json; fit them into different folders"
            )
            .into());
        }
    }
    let checked = |(input, stem): (&PathBuf, &String)| {
        let request = request::request(args, input, stem).and_then(self::checked);
        request.map_err(|error| format!("{}: {error}", input.display()))
    };
    let requests = args.inputs.iter().zip(&stems).map(checked).collect::<Result<Vec<_>, _>>()?;
    make_folder(&args.out)?;
    let mut rows = Vec::new();
    let mut failure = None;
    for (input, request) in args.inputs.iter().zip(&requests) {
        match one(args, input, request) {
            Ok(of_input) => rows.extend(of_input),
            // What was fitted before is on disk: it is reported before the error.
            Err(error) => {
                failure = Some(error);
                break;
            }
        }
    }
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        writeln!(out)?;
    } else if !rows.is_empty() {
        report::table(&mut out, &rows)?;
    }
    failure.map_or(Ok(()), Err)
}

fn stem(input: &Path) -> Result<String, Box<dyn Error>> {
    let stem = input.file_stem().ok_or_else(|| format!("{} names no file", input.display()))?;
    Ok(stem.to_string_lossy().into_owned())
}

/// Fits what is asked for of one input, here or on a server, and writes it.
fn one(args: &FitArgs, input: &Path, request: &FitRequest) -> Result<Vec<Row>, Box<dyn Error>> {
    let bar = progress_bar(&request.name);
    bar.set_message("reading");
    let reading = args.mesh.read(input)?;
    bar.suspend(|| note(input, &reading));
    let (used_points, row) = (reading.mesh.used_points(), ReadingRow::from(&reading));
    let mesh = reading.mesh;
    let made = match &args.server {
        Some(url) => execute_on(url, request, &mesh.points, &mesh.triangles, &bar),
        None => fit_mesh(request, mesh, |_, said| tell(&bar, said)).map_err(Into::into),
    }
    .map_err(|error| format!("{}: {error}", input.display()))?;
    bar.finish_and_clear();
    report::write(&args.out, &InputMesh { path: input, used_points, reading: row }, request, &made)
}

/// Says on a bar how far a fit has come.
fn tell(bar: &ProgressBar, progress: Progress) -> ControlFlow<()> {
    let Progress { round, iterations, active_points, worst_violation, gap } = progress;
    bar.set_message(format!(
        "round {round}, step {iterations}, {gap:.0e} from the optimum of {active_points} points, others outside by \
         {worst_violation:.0e}"
    ));
    ControlFlow::Continue(())
}
