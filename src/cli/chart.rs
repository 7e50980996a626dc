//! `sublevel chart`.

use super::write_atomically;
use crate::chart::{Table1Progress, table1};
use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Measure on this machine, and draw: reports as Markdown with SVG pictures, and their raw numbers as CSV
///
/// Example: sublevel chart table1 --meshes psb --out docs
#[derive(Debug, Args)]
pub(super) struct ChartArgs {
    #[command(subcommand)]
    figure: Figure,
}

#[derive(Debug, Subcommand)]
enum Figure {
    Table1(Table1Args),
}

/// Volumes and construction times of all bounding sets around five meshes, beside the paper's Table I
///
/// Builds balls, boxes and bodies of every objective and degree around the meshes 10 (human), 101 (chair), 121 (octopus), 181
/// (hand) and 361 (vase) of the Princeton Mesh Segmentation Benchmark. Writes table1.md, table1.csv and the pictures
/// table1*.svg. Takes about five minutes on one core.
#[derive(Debug, Args)]
struct Table1Args {
    /// Folder with 10.off, 101.off, 121.off, 181.off and 361.off
    #[arg(long, value_name = "DIR")]
    meshes: PathBuf,
    /// Folder for the report; made with its parents when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-chart")]
    out: PathBuf,
    /// Only up to degree 4: half a minute
    #[arg(long)]
    quick: bool,
}

/// Measures and writes what is asked for.
pub(super) fn run(args: &ChartArgs) -> Result<(), Box<dyn Error>> {
    match &args.figure {
        Figure::Table1(args) => run_table1(args),
    }
}

fn run_table1(args: &Table1Args) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(&args.out)
        .map_err(|error| format!("can not make {}: {error}; choose another --out", args.out.display()))?;
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_style(ProgressStyle::with_template("{spinner} [{elapsed_precise}] {wide_msg}")?);
    let table = table1(&args.meshes, args.quick, &mut |progress| {
        let Table1Progress { done, cells, at } = progress;
        bar.set_message(format!("{} of {cells}: {at}", done + 1));
        bar.tick();
        ControlFlow::Continue(())
    })?;
    bar.finish_and_clear();
    let mut pictures = vec![("table1.svg", table.volume_against_time()?)];
    pictures.extend(table.pictures());
    let names: Vec<&str> = pictures.iter().map(|(name, _)| *name).collect();
    let report = table.markdown(&names);
    for (name, content) in [("table1.md", &report), ("table1.csv", &table.csv())] {
        write_atomically(&args.out.join(name), content)?;
    }
    for (name, svg) in &pictures {
        write_atomically(&args.out.join(name), svg)?;
    }
    writeln!(io::stdout().lock(), "{}", args.out.join("table1.md").display())?;
    Ok(())
}
