//! The figures, and the command line that makes them.

mod ablation;
mod arguments;
mod output;
mod stability;
mod table1;

use crate::accuracy::accuracy;
use crate::comparison::FitCache;
use crate::cost::{Messages, cost};
use crate::detail::detail;
use crate::fits::fits;
use crate::messages::messages;
use crate::numbers;
use crate::pairs::pairs;
use crate::panda::panda;
use crate::scenes::scenes;
use crate::sets::sets;
use crate::speed::speed;
use crate::stability::Method;
use crate::warm::warm;
use ablation::run_ablation;
use arguments::{Arguments, Common, Figure, FitArgs};
use clap::Parser;
use indicatif::ProgressBar;
use output::{Drawn, bar, fill, make_folder, print_place, redraw, show_progress, write_numbers, write_report};
use stability::{measure_stability, run_stability};
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use sublevel::cli::{self, write_atomically};
use sublevel::fit::{FitOptions, ReadOptions, fit, read_mesh};
use table1::{redraw_table1, run_table1};

/// Measures and writes a figure.
type Run = fn(&Common) -> Drawn;

/// Runs the command line of this process; exit codes as `sublevel`.
pub fn main() -> ExitCode {
    cli::exit_code(run(&Arguments::parse().figure).map(|()| true))
}

/// Measures and writes what is asked for.
fn run(figure: &Figure) -> Result<(), Box<dyn Error>> {
    let drawn = match figure {
        Figure::All(args) => return run_all(&args.common),
        Figure::Ablation(args) => return run_ablation(args),
        Figure::Stability(args) => return run_stability(args),
        Figure::Fit(args) => return run_fit(args),
        Figure::Speed(args) if args.common.redraw => redraw(&args.common.out, "speed"),
        Figure::Speed(args) => run_speed(&args.common),
        Figure::Warm(args) if args.common.redraw => redraw(&args.common.out, "warm"),
        Figure::Warm(args) => run_warm(&args.common),
        Figure::Detail(args) if args.common.redraw => redraw(&args.common.out, "detail"),
        Figure::Detail(args) => run_detail(&args.common),
        Figure::Accuracy(args) if args.common.redraw => redraw(&args.common.out, "accuracy"),
        Figure::Accuracy(args) => run_accuracy(&args.common),
        Figure::Cost(args) if args.common.redraw => redraw(&args.common.out, "cost"),
        Figure::Cost(args) => run_cost(&args.common),
        Figure::Fits(args) if args.common.redraw => redraw(&args.common.out, "fits"),
        Figure::Fits(args) => run_fits(&args.common),
        Figure::Pairs(args) if args.common.redraw => redraw(&args.common.out, "pairs"),
        Figure::Pairs(args) => run_pairs(&args.common),
        Figure::Panda(args) if args.common.redraw => redraw(&args.common.out, "panda"),
        Figure::Panda(args) => run_panda(&args.common, args.problems.as_deref(), args.json),
        Figure::Scenes(args) if args.common.redraw => redraw(&args.common.out, "scenes"),
        Figure::Scenes(args) => run_scenes(&args.common),
        Figure::Sets(args) if args.common.redraw => redraw(&args.common.out, "sets"),
        Figure::Sets(args) => run_sets(&args.common),
        Figure::Tables(args) => return write_numbers(args),
        Figure::Table1(args) if args.redraw => redraw_table1(&args.meshes, &args.out),
        Figure::Table1(args) => run_table1(&args.meshes, &args.out, args.quick),
    };
    drawn.map(drop)
}

fn run_all(args: &Common) -> Result<(), Box<dyn Error>> {
    if args.redraw {
        // Table I takes the meshes, and a command of its own.
        return ["speed", "pairs", "accuracy", "cost", "fits", "sets", "panda", "scenes", "warm", "detail"]
            .into_iter()
            .try_for_each(|name| redraw(&args.out, name).map(drop));
    }
    let figures: [(&str, &str, Run); 11] = [
        ("speed", "Speed against accuracy", run_speed),
        ("pairs", "Pairs by type", run_pairs),
        ("accuracy", "Solver accuracy against time", run_accuracy),
        ("cost", "Cost growth", run_cost),
        ("fits", "Fits", run_fits),
        ("sets", "Sets that need not be convex", run_sets),
        ("panda", "A planner's workload", |args| run_panda(args, None, false)),
        ("scenes", "Scenes and questions", run_scenes),
        ("warm", "Warm starts", run_warm),
        ("detail", "Detail", run_detail),
        ("table1", "Table I of the paper", |args| run_table1(&args.data().join("psb"), &args.out, args.quick)),
    ];
    let flags = if args.quick { " --quick" } else { "" };
    let mut text = format!(
        "# Charts\n\nMade by `sublevel-bench all --data DIR{flags}`. Each report names its machine, commit and versions, and the command that makes it \
         again alone.\n\n## Stability\n\n"
    );
    let found = measure_stability(&args.out, &Method::ALL, args.quick)?;
    text += &format!("{}\n[How this was judged, and each failure](stability.md)\n", found.table());
    for (name, title, run) in figures {
        let drawn = run(args)?;
        text += &format!("\n## {title}\n\n");
        if let Some(picture) = drawn.first() {
            text += &format!("![{title}]({picture})\n\n");
        }
        text += &format!("[The report]({name}.md), [the numbers]({name}.csv)\n");
    }
    let index = args.out.join("charts.md");
    write_atomically(&index, &text)?;
    writeln!(io::stdout().lock(), "{}", index.display())?;
    Ok(())
}

fn run_fit(args: &FitArgs) -> Result<(), Box<dyn Error>> {
    let mesh = read_mesh(&args.input, &ReadOptions::default())?.mesh;
    let options = FitOptions { degree: args.degree, ..FitOptions::default() };
    let body = fit("it", &mesh.points, &options, &mut |_| ControlFlow::Continue(()))?.body;
    make_folder(&args.out)?;
    write_atomically(&args.out.join("it.json"), &body.to_json())
}

fn run_speed(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = speed(args.data(), cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "speed", &found.markdown(), &found.csv())?;
        redraw(&args.out, "speed")
    })
}

fn run_warm(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = warm(args.data(), cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "warm", &found.markdown(), &found.csv())?;
        redraw(&args.out, "warm")
    })
}

fn run_detail(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = detail(args.data(), cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_atomically(&args.out.join("detail-parts.csv"), &found.parts_csv())?;
        write_report(&args.out, "detail", &found.markdown(), &found.csv())?;
        redraw(&args.out, "detail")
    })
}

fn run_accuracy(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = accuracy(args.data(), cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "accuracy", &found.markdown(), &found.csv())?;
        redraw(&args.out, "accuracy")
    })
}

fn run_cost(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let mut sent = |sizes: &[usize]| messages(sizes).map_err(|error| error.to_string());
        let program = std::env::current_exe().ok();
        let parts: (Messages<'_>, _) = (&mut sent, program.as_deref());
        let found = cost(args.data(), cache, args.quick, parts, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "cost", &found.markdown(), &found.csv())?;
        redraw(&args.out, "cost")
    })
}

fn run_pairs(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = pairs(args.data(), cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "pairs", &found.markdown(), &found.csv())?;
        redraw(&args.out, "pairs")
    })
}

fn run_fits(args: &Common) -> Drawn {
    with_fit_cache(args, |_, bar| {
        let found = fits(args.data(), args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "fits", &found.markdown(), &found.csv())?;
        redraw(&args.out, "fits")
    })
}

fn run_sets(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = sets(args.data(), cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "sets", &found.markdown(), &found.csv())?;
        redraw(&args.out, "sets")
    })
}

fn run_panda(args: &Common, problems: Option<&Path>, json: bool) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = panda(args.data(), problems, cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "panda", &found.markdown(), &found.csv())?;
        let pictures = numbers::pictures("panda.csv", &args.out)?;
        let names = fill(&args.out, "panda", pictures)?;
        if json {
            writeln!(io::stdout().lock(), "{}", found.json()?)?;
        } else {
            print_place(&args.out, "panda")?;
        }
        Ok(names)
    })
}

fn run_scenes(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = scenes(args.data(), cache, args.quick, &mut |at| show_progress(bar, at))?;
        write_report(&args.out, "scenes", &found.markdown(), &found.csv())?;
        redraw(&args.out, "scenes")
    })
}

/// Makes the folders, and does the work under a spinner.
fn with_fit_cache(args: &Common, work: impl FnOnce(&FitCache, &ProgressBar) -> Drawn) -> Drawn {
    make_folder(&args.out)?;
    let cache = FitCache::new(&args.fits)?;
    let bar = bar()?;
    let drawn = work(&cache, &bar);
    bar.finish_and_clear();
    drawn
}
