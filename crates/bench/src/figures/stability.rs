//! The figure of stability: a report, a comparison with an earlier run, or one case replayed.

use super::arguments::StabilityArgs;
use super::output::{bar, make_folder, print_place, show_progress, write_report};
use crate::stability::{Earlier, Lost, Method, Stability, serve, stability};
use std::error::Error;
use std::io;
use std::path::Path;
use sublevel::cli;

pub(super) fn run_stability(args: &StabilityArgs) -> Result<(), Box<dyn Error>> {
    if let Some(share) = &args.replay {
        return Ok(serve(share, args.json, &mut io::stdout().lock())?);
    }
    // Read first: what it is for is known before the work.
    let guard = args.guard.as_ref().map(|path| guard(path)).transpose()?;
    let methods = if args.methods.is_empty() { &Method::ALL[..] } else { &args.methods };
    let found = measure_stability(&args.out, methods, args.quick)?;
    let lost = guard.map_or(Vec::new(), |earlier| found.lost_against(&earlier));
    if lost.is_empty() {
        return Ok(());
    }
    let rows = lost.iter().map(|Lost { family, method, what }| format!("family {family}, {method}: {what}"));
    Err(rows.collect::<Vec<_>>().join("\n").into())
}

fn guard(path: &Path) -> Result<Earlier, Box<dyn Error>> {
    cli::read(path)?.parse().map_err(|error| format!("{}: {error}", path.display()).into())
}

pub(super) fn measure_stability(out: &Path, methods: &[Method], quick: bool) -> Result<Stability, Box<dyn Error>> {
    make_folder(out)?;
    let bar = bar()?;
    let found = stability(&std::env::current_exe()?, methods, quick, &mut |at| show_progress(&bar, at))?;
    bar.finish_and_clear();
    write_report(out, "stability", &found.markdown(), &found.csv())?;
    print_place(out, "stability")?;
    Ok(found)
}
