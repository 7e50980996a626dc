//! `sublevel fit --group`.

use super::files::make_folder;
use super::files::{read_obstacle, write_atomically};
use super::fit::args::FitArgs;
use super::fit::remote::execute as execute_on;
use super::fit::request::{checked, request_of_group};
use super::progress::progress_bar;
use super::push;
use crate::body::{Body, Obstacle};
use crate::fit::Progress;
use crate::jobs::{FitOutput, Shapes, fit_group};
use crate::robot::counted;
use crate::store::{FitRequest, FittedBody};
use indicatif::ProgressBar;
use serde::Serialize;
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::time::Instant;

#[derive(Serialize)]
struct Row {
    body: String,
    /// Names of the bodies inside.
    members: Vec<String>,
    degree: usize,
    volume_m3: f64,
    /// Sum of theirs.
    members_volume_m3: f64,
    /// Proven bound of the distance of any point of the body from their convex hull; none for a
    /// body left as it is.
    gap_m: Option<f64>,
    optimality_gap: Option<f64>,
    /// What is not proven is an error.
    proven: bool,
}

/// Reads the bodies, puts them into one or several, and writes those.
pub(super) fn run(args: &FitArgs, name: &str) -> Result<(), Box<dyn Error>> {
    let start = Instant::now();
    let obstacles = args.inputs.iter().map(|path| read_obstacle(path)).collect::<Result<Vec<_>, _>>()?;
    let request = checked(request_of_group(args, name, &obstacles))?;
    make_folder(&args.out)?;
    let bar = progress_bar(name);
    let FitOutput { outcome, shapes, .. } = match &args.server {
        Some(url) => execute_there(args, url, &request, &bar)?,
        None => fit_group(&request, &obstacles, |_, said| tell(&bar, said))?,
    };
    bar.finish_and_clear();
    let Shapes::Bodies(made) = shapes else { return Err("groups become bodies; are the versions the same?".into()) };
    let rows = made.iter().zip(&outcome.bodies).map(|(body, took)| write(args, body, took, &obstacles));
    let rows = rows.collect::<Result<Vec<_>, _>>()?;
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        writeln!(out)?;
    } else {
        table(&mut out, &rows)?;
        let volume = |of: &dyn Fn(&Row) -> f64| rows.iter().map(of).sum::<f64>();
        let (before, after) = (volume(&|row| row.members_volume_m3), volume(&|row| row.volume_m3));
        writeln!(
            out,
            "{} of {before:.4e} m³ in {} of {after:.4e} m³, {:+.1} %, in {:.1} s",
            counted(obstacles.len(), "body", "bodies"),
            rows.len(),
            100.0 * (after / before - 1.0),
            start.elapsed().as_secs_f64()
        )?;
    }
    Ok(())
}

fn tell(bar: &ProgressBar, progress: Progress) -> ControlFlow<()> {
    bar.set_message(format!("step {}, {:.0e} from the optimum", progress.iterations, progress.gap));
    ControlFlow::Continue(())
}

/// The server must have the bodies first, and it stores no others.
fn execute_there(
    args: &FitArgs,
    url: &str,
    request: &FitRequest,
    bar: &ProgressBar,
) -> Result<FitOutput, Box<dyn Error>> {
    bar.set_message("sending");
    push::store(url, &args.inputs)?;
    execute_on(url, request, &[], &[], bar)
}

/// Writes one body and describes it.
fn write(args: &FitArgs, body: &Body, took: &FittedBody, obstacles: &[Obstacle]) -> Result<Row, Box<dyn Error>> {
    let file = args.out.join(format!("{}-d{}.json", body.name(), body.degree()));
    write_atomically(&file, &body.to_json())?;
    let members = took.members.iter().filter_map(|&member| obstacles.get(member));
    Ok(Row {
        body: file.display().to_string(),
        members: members.clone().map(|member| member.name().to_owned()).collect(),
        degree: body.degree(),
        volume_m3: body.volume().volume_m3,
        members_volume_m3: members.map(|member| member.volume().volume_m3).sum(),
        gap_m: took.gap_m,
        optimality_gap: took.optimum.as_ref().and_then(|optimum| optimum.optimality_gap),
        proven: true,
    })
}

fn table(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    let width = rows.iter().map(|row| row.body.chars().count()).max().unwrap_or(0).max(4);
    writeln!(out, "{:width$}  degree  members    volume m³  volume:members      gap m  proven", "body")?;
    for row in rows {
        writeln!(
            out,
            "{:width$}  {:>6}  {:>7}  {:>11.4e}  {:>14.3}  {:>9}  {:>6}",
            row.body,
            row.degree,
            row.members.len(),
            row.volume_m3,
            row.volume_m3 / row.members_volume_m3,
            row.gap_m.map_or_else(|| "-".to_owned(), |gap| format!("{gap:.3e}")),
            if row.proven { "yes" } else { "no" }
        )?;
    }
    Ok(())
}
