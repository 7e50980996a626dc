//! Times every measure on one thread, beside the GJK of other libraries on the convex hulls of the
//! same objects.
//!
//! `cargo bench -p sublevel-bench --bench measures -- --help` says how. Every row walks the same
//! poses; the rows take turns, pass by pass, so that a change of clock or load meets them all, and
//! the median pass counts.

mod machine;
mod motion;
mod objects;
mod peers;
mod report;
mod rows;
mod sweep;

use clap::Parser;
use motion::Kind;
use objects::{Object, Pair};
use report::{Report, Table};
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use sublevel_bench::comparison::{Coal, CoalRun};
use sublevel_bench::enter_workspace;

/// Time the measures and compare them with GJK on the hulls
///
/// Bodies are fitted once to the meshes in SUBLEVEL_DATA and kept in target/bench-bodies (delete it
/// after changes to the fit), where the pose files are left, too. SUBLEVEL_COAL names the program
/// that '../shared/peers/build.sh' builds; without it coal's rows, and the ratios to them, are left
/// out. SUBLEVEL_SIMD=avx2 measures what processors without AVX-512 do.
#[derive(Debug, Parser)]
#[command(name = "measures", max_term_width = 100)]
struct Args {
    /// Only this pair (repeatable): chair-human, hand-vase or octopus-chair
    #[arg(long, value_name = "NAME")]
    pair: Vec<String>,
    /// Only this kind of motion
    #[arg(long)]
    kind: Option<Kind>,
    /// Fewer poses and passes: a look, not a result
    #[arg(long)]
    quick: bool,
    /// Write the results as JSON, too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the results as CSV, too, with machine, commit and peers in its head: docs/measures.csv
    /// is what README and docs/benchmarks.md show once `make docs-numbers` has run
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Fail when a target is missed
    #[arg(long)]
    strict: bool,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

/// How much is run.
struct Effort {
    trajectories: usize,
    poses: usize,
    passes: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = Args::parse();
    if args.bench {
        enter_workspace()?;
    }
    // A run takes minutes: a file that cannot be written is refused before.
    for (flag, path) in [("--json", &args.json), ("--csv", &args.csv)] {
        if let Some(path) = path {
            fs::OpenOptions::new().append(true).create(true).open(path).map_err(|error| {
                format!("{flag}: {}: {error}; relative paths begin at the root of the workspace", path.display())
            })?;
        }
    }
    let effort = if args.quick {
        Effort { trajectories: 1, poses: 1024, passes: 3 }
    } else {
        Effort { trajectories: 4, poses: 1024, passes: 15 }
    };
    let names: Vec<String> = objects::PAIRS.iter().map(|(a, b, _)| format!("{a}-{b}")).collect();
    if let Some(unknown) = args.pair.iter().find(|&name| !names.contains(name)) {
        return Err(format!("--pair: no pair is named '{unknown}'; there are {}", names.join(", ")).into());
    }

    let coal = Coal::from_environment()?;
    if coal.is_none() {
        eprintln!(
            "note: without coal; build it with '../shared/peers/build.sh DIR' and set SUBLEVEL_COAL=DIR/coal_gjk"
        );
    }
    let mut report = Report::new(coal.as_ref());
    report.print_head();
    for ((a, b, coal_warm), name) in objects::PAIRS.into_iter().zip(names) {
        if !args.pair.is_empty() && !args.pair.contains(&name) {
            continue;
        }
        let pair = Pair { name, a: Object::load(a)?, b: Object::load(b)?, coal_warm };
        for kind in [Kind::Separated, Kind::Grazing, Kind::Contact] {
            if args.kind.is_some_and(|only| only != kind) {
                continue;
            }
            // Coal's rows are distances.
            let coal = coal.as_ref().filter(|_| kind != Kind::Contact);
            let separated = report.table(&pair.name, Kind::Separated);
            let table = compare(&pair, kind, &effort, coal, separated)?;
            table.print(separated);
            report.tables.push(table);
        }
    }
    report.end();
    report.print_foot();
    if let Some(path) = args.json {
        fs::write(&path, serde_json::to_string_pretty(&report)? + "\n")
            .map_err(|error| format!("--json: {}: {error}", path.display()))?;
    }
    if let Some(path) = args.csv {
        fs::write(&path, report.csv(args.quick)).map_err(|error| format!("--csv: {}: {error}", path.display()))?;
    }
    let missed = report.missed();
    if args.strict && !missed.is_empty() {
        return Err(format!("targets are missed:\n{}", missed.join("\n")).into());
    }
    Ok(())
}

/// One pair on one kind of motion: all rows and coal in turns.
fn compare(
    pair: &Pair,
    kind: Kind,
    effort: &Effort,
    coal: Option<&Coal>,
    separated: Option<&Table>,
) -> Result<Table, Box<dyn Error>> {
    let scene = rows::Scene::new(pair, kind, effort.trajectories, effort.poses)?;
    let mut rows = rows::all(&scene);
    let mut coal = coal.map(|coal| peers::start(coal, &scene)).transpose()?;
    for _ in 0..effort.passes {
        if let Some(coal) = &mut coal {
            coal.pass()?;
        }
        rows.iter_mut().for_each(|row| row.timed.turn());
    }
    if let Some(coal) = &coal {
        peers::check(coal, &scene)?;
    }
    Ok(Table::new(&scene, &rows, coal.as_ref().map(CoalRun::times), separated))
}
