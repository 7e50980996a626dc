//! The figures, and the command line that makes them.

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
use crate::stability::{Earlier, Lost, Method, Share, Stability, serve, stability};
use crate::table1::{Table1, Table1Error, Table1Progress, table1};
use crate::warm::warm;
use clap::{Args, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use sublevel::cli::{self, write_atomically};
use sublevel::fit::{FitOptions, ReadOptions, fit, read_mesh};

/// Measure on this machine, and draw: reports as Markdown with SVG pictures, and their raw numbers
/// as CSV
///
/// Examples:
///
/// sublevel-bench all --data DIR --quick
///
/// sublevel-bench table1 --meshes psb --out docs
#[derive(Debug, Parser)]
#[command(name = "sublevel-bench", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    figure: Figure,
}

#[derive(Debug, Subcommand)]
enum Figure {
    All(AllArgs),
    Speed(SpeedArgs),
    Warm(WarmArgs),
    Detail(DetailArgs),
    Stability(StabilityArgs),
    Accuracy(AccuracyArgs),
    Cost(CostArgs),
    Fits(FitsArgs),
    Pairs(PairsArgs),
    Panda(PandaArgs),
    Scenes(ScenesArgs),
    Sets(SetsArgs),
    Table1(Table1Args),
    Tables(TablesArgs),
    #[command(hide = true)]
    Fit(FitArgs),
}

/// Fit one body: what the figure of cost watches for the memory that a fit takes
#[derive(Debug, Args)]
struct FitArgs {
    input: PathBuf,
    #[arg(long)]
    degree: usize,
    #[arg(long)]
    out: PathBuf,
}

/// All figures, one after the other, and charts.md, which shows the main ones and leads to the
/// others
///
/// Keep the machine quiet: times are measured. Takes about an hour on one core,
/// and under five minutes with --quick, once the fits are kept. Clarabel and coal take part as the
/// figures' own help says.
#[derive(Debug, Args)]
struct AllArgs {
    #[command(flatten)]
    common: Common,
}

/// Volumes and construction times of all bounding sets around five meshes, beside the paper's Table
/// I
///
/// Builds balls, boxes and bodies of every objective and degree around the meshes 10 (human), 101
/// (chair), 121 (octopus), 181 (hand) and 361 (vase) of the Princeton Mesh Segmentation Benchmark.
/// Writes table1.md, table1.csv and the pictures table1*.svg. Takes about five minutes on one core.
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
    /// Take volumes and times from the table1.csv that lies in the folder of the report; fit again
    /// only what the pictures show, and draw it
    #[arg(long, conflicts_with = "quick")]
    redraw: bool,
}

/// Write the numbers of pages again from the CSV files: nothing is measured
///
/// Blocks between `<!-- from FILE.csv: NAME -->` and `<!-- end -->` are replaced in all pages of
/// --out and in those that are named.
///
/// sublevel-bench tables --out docs README.md
#[derive(Debug, Args)]
struct TablesArgs {
    /// Folder with the CSV files and their pages
    #[arg(long, value_name = "DIR", default_value = "docs")]
    out: PathBuf,
    /// Pages elsewhere that show numbers of these CSV files
    pages: Vec<PathBuf>,
}

/// Time of a distance query against model error: our representations beside hulls, simplified hulls
/// and meshes of parry and coal
///
/// Pairs of the five meshes of the Princeton benchmark and of household objects. Writes speed.md,
/// speed.csv and the pictures speed*.svg. Fits are made once and kept, which takes a few minutes on
/// one core; measuring takes about a quarter of an hour. Coal takes part when SUBLEVEL_COAL names
/// the program that times it.
#[derive(Debug, Args)]
struct SpeedArgs {
    #[command(flatten)]
    common: Common,
}

/// Time and iterations of queries with a hint against how far the pose before is away; and the
/// paper's experiment
///
/// Steps from a 10 000th of half the larger diameter to poses that have nothing to do with each
/// other; then the chair swept past the human, level distances and their times beside the paper's.
/// Writes warm.md, warm.csv and the pictures warm*.svg.
#[derive(Debug, Args)]
struct WarmArgs {
    #[command(flatten)]
    common: Common,
}

/// What each rung of the ladder buys: model error, gap, iterations, time, and how many questions it
/// settles; and convex parts
///
/// The rungs are ball, ellipsoid and degree 4, 6, 8; the question is "nearer than m?" of random
/// pairs, m from touching to ten object sizes. Writes detail.md, detail.csv, detail-parts.csv and
/// the pictures detail*.svg. Convex parts are compared with parry's V-HACD.
#[derive(Debug, Args)]
struct DetailArgs {
    #[command(flatten)]
    common: Common,
}

/// Families of queries that broke collision libraries, put to our solver and to others: who passes
///
/// Touching, deep, far, tiny, needle-like, nearly parallel, badly hinted and so on: each case is
/// drawn from its seed alone, put in a child process with a time limit, and judged by points and
/// planes. Writes stability.md and stability.csv. Takes a few minutes. Coal takes part when
/// SUBLEVEL_COAL names the program that times it.
///
/// Examples:
///
/// sublevel-bench stability --out docs
///
/// sublevel-bench stability --replay 13/cold/5
///
/// sublevel-bench stability --quick --methods cold,warm,batch --guard docs/stability.csv
#[derive(Debug, Args)]
struct StabilityArgs {
    /// Folder for the report; made with its parents when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-chart")]
    out: PathBuf,
    /// A tenth of the cases: under a minute
    #[arg(long)]
    quick: bool,
    /// Only these columns: cold, warm, batch, newton, slsqp, clarabel, parry, coal
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    methods: Vec<Method>,
    /// Fail, with the row named, where ours fails more often than in this stability.csv of an
    /// earlier run
    #[arg(long, value_name = "FILE")]
    guard: Option<PathBuf>,
    /// Put one case here and now, and print what came of it: the number of its family, the method
    /// and the seed, FROM-TO for several
    #[arg(long, value_name = "FAMILY/METHOD/SEED", conflicts_with_all = ["out", "quick", "guard", "methods"])]
    replay: Option<Share>,
    /// With --replay, print one JSON object per case
    #[arg(long, requires = "replay")]
    json: bool,
}

/// How near our solver and the obvious alternatives come to the distance, in how much time, and
/// where they stop coming nearer
///
/// Ours cold and warm at tolerances from 1e-3 to 1e-12; plain Newton, SLSQP, level 0 of the
/// hierarchy by clarabel, and GJK on hulls of boundary points. Clarabel takes part when `cargo
/// build --release -p sublevel-bench --example clarabel` has made its program, or SUBLEVEL_CLARABEL
/// names it; coal when SUBLEVEL_COAL names the program that times it. Writes accuracy.md,
/// accuracy.csv and the pictures accuracy*.svg.
#[derive(Debug, Args)]
struct AccuracyArgs {
    #[command(flatten)]
    common: Common,
}

/// How time and memory grow: queries with degree, constraints, parts and poses of a batch, messages
/// with their pairs, fits with degree and points
///
/// Chair and human of the Princeton benchmark; a server on loopback in this process; fits of up to
/// a million random points. Exponents stand beside the curves. Writes cost.md, cost.csv and the
/// pictures cost*.svg.
#[derive(Debug, Args)]
struct CostArgs {
    #[command(flatten)]
    common: Common,
}

/// What the server adds to the library, and how scenes grow: calls beside the same question in
/// process, ticks of up to 100 000 objects, poses at 1 kHz, forks, ladders
///
/// A server on loopback in this process, on all cores; the robot and problems are those of
/// DIR/panda. Writes scenes.md, scenes.csv and scenes-ticks.svg.
#[derive(Debug, Args)]
struct ScenesArgs {
    #[command(flatten)]
    common: Common,
}

/// Pairs by type: ball, ellipsoid, degree 4, 6 and 8, slab-cut, box, cylinder and capsule, each
/// against each: distances cold and warm, and decisions, beside coal and parry
///
/// Shapes about the chair and the human of the Princeton benchmark. Writes pairs.md, pairs.csv and
/// pairs-*.svg. Takes about a minute on one core, once the fits are kept; a second with --quick.
/// Coal takes part when SUBLEVEL_COAL names the program that times it.
#[derive(Debug, Args)]
struct PairsArgs {
    #[command(flatten)]
    common: Common,
}

/// A planner's workload: states and motions of a Franka Emika Panda among boxes and cylinders, µs
/// per state and per radian against the free states that are kept
///
/// Links as spheres, ellipsoids, bodies of degree 4 and 6, ladders and compounds, in process and
/// over gRPC in batches of 1 000; motions proven and sampled. The robot and problems are those of
/// DIR/panda. Writes panda.md, panda.csv and panda-*.svg. Fits are made once and kept, which takes
/// some minutes on one core; measuring takes about ten minutes, one with --quick. Coal takes
/// part when SUBLEVEL_COAL_PANDA names the program that times it on states of this robot.
#[derive(Debug, Args)]
struct PandaArgs {
    #[command(flatten)]
    common: Common,
    /// Other problems, in the format of DIR/panda/panda_problems.json
    #[arg(long, value_name = "FILE", conflicts_with = "redraw")]
    problems: Option<PathBuf>,
    /// Print the numbers as one JSON object instead of the place of the report
    #[arg(long, conflicts_with = "redraw")]
    json: bool,
}

/// Time of a fit against the volume of its body: by each solver, refined, and over the smaller
/// cones
///
/// The five meshes of the paper's Table I at degrees 2 to 8. Writes fits.md, fits.csv and fits.svg.
/// Takes about ten minutes on one core, most of them for degree 8 by clarabel; a minute with
/// --quick, which ends at degree 6.
#[derive(Debug, Args)]
struct FitsArgs {
    #[command(flatten)]
    common: Common,
}

/// Sets that need not be convex: brackets against time by branch and bound and by the hierarchy,
/// and models of objects beside compounds and convex bodies
///
/// Random pairs of degree 4 and 6; mug, wingnut, octopus, chair and hand. Writes sets.md, sets.csv
/// and sets*.svg. Takes about ten minutes on one core, once the fits are kept; a minute with
/// --quick.
#[derive(Debug, Args)]
struct SetsArgs {
    #[command(flatten)]
    common: Common,
}

/// What all figures with bodies around meshes take.
#[derive(Debug, Args)]
struct Common {
    /// Folder with psb/101.off, meshes/mbm_mug.off and so on
    #[arg(long, value_name = "DIR", required_unless_present = "redraw")]
    data: Option<PathBuf>,
    /// Folder for the report; made with its parents when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-chart")]
    out: PathBuf,
    /// Folder where fits are kept between runs; delete it after changes to the fit
    #[arg(long, value_name = "DIR", default_value = "target/bench-bodies")]
    fits: PathBuf,
    /// Fewer objects, representations and poses: a look, not a result
    #[arg(long)]
    quick: bool,
    /// Measure nothing: draw the pictures and write the tables again from the CSV that an earlier
    /// run left in the folder of the report
    #[arg(long, conflicts_with_all = ["quick", "data"])]
    redraw: bool,
}

impl Common {
    /// The folder; only `--redraw` does without.
    fn data(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new(""))
    }
}

/// The pictures that a figure wrote, the most telling first.
type Drawn = Result<Vec<String>, Box<dyn Error>>;

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
        let found = speed(args.data(), cache, args.quick, &mut |at| tell(bar, at))?;
        write_report(&args.out, "speed", &found.markdown(), &found.csv())?;
        redraw(&args.out, "speed")
    })
}

fn run_warm(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = warm(args.data(), cache, args.quick, &mut |at| tell(bar, at))?;
        write_report(&args.out, "warm", &found.markdown(), &found.csv())?;
        redraw(&args.out, "warm")
    })
}

fn run_detail(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = detail(args.data(), cache, args.quick, &mut |at| tell(bar, at))?;
        write_atomically(&args.out.join("detail-parts.csv"), &found.parts_csv())?;
        write_report(&args.out, "detail", &found.markdown(), &found.csv())?;
        redraw(&args.out, "detail")
    })
}

fn run_accuracy(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = accuracy(args.data(), cache, args.quick, &mut |at| tell(bar, at))?;
        write_report(&args.out, "accuracy", &found.markdown(), &found.csv())?;
        redraw(&args.out, "accuracy")
    })
}

fn run_cost(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let mut sent = |sizes: &[usize]| messages(sizes).map_err(|error| error.to_string());
        let program = std::env::current_exe().ok();
        let parts: (Messages<'_>, _) = (&mut sent, program.as_deref());
        let found = cost(args.data(), cache, args.quick, parts, &mut |at| tell(bar, at))?;
        write_report(&args.out, "cost", &found.markdown(), &found.csv())?;
        redraw(&args.out, "cost")
    })
}

fn run_pairs(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = pairs(args.data(), cache, args.quick, &mut |at| tell(bar, at))?;
        write_report(&args.out, "pairs", &found.markdown(), &found.csv())?;
        redraw(&args.out, "pairs")
    })
}

fn run_fits(args: &Common) -> Drawn {
    with_fit_cache(args, |_, bar| {
        let found = fits(args.data(), args.quick, &mut |at| tell(bar, at))?;
        write_report(&args.out, "fits", &found.markdown(), &found.csv())?;
        redraw(&args.out, "fits")
    })
}

fn run_sets(args: &Common) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = sets(args.data(), cache, args.quick, &mut |at| tell(bar, at))?;
        write_report(&args.out, "sets", &found.markdown(), &found.csv())?;
        redraw(&args.out, "sets")
    })
}

fn run_panda(args: &Common, problems: Option<&Path>, json: bool) -> Drawn {
    with_fit_cache(args, |cache, bar| {
        let found = panda(args.data(), problems, cache, args.quick, &mut |at| tell(bar, at))?;
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
        let found = scenes(args.data(), cache, args.quick, &mut |at| tell(bar, at))?;
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

fn run_stability(args: &StabilityArgs) -> Result<(), Box<dyn Error>> {
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

fn measure_stability(out: &Path, methods: &[Method], quick: bool) -> Result<Stability, Box<dyn Error>> {
    make_folder(out)?;
    let bar = bar()?;
    let found = stability(&std::env::current_exe()?, methods, quick, &mut |at| tell(&bar, at))?;
    bar.finish_and_clear();
    write_report(out, "stability", &found.markdown(), &found.csv())?;
    print_place(out, "stability")?;
    Ok(found)
}

fn make_folder(out: &Path) -> Result<(), Box<dyn Error>> {
    let made = std::fs::create_dir_all(out);
    Ok(made.map_err(|error| format!("cannot make {}: {error}; choose another --out", out.display()))?)
}

fn bar() -> Result<ProgressBar, Box<dyn Error>> {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_style(ProgressStyle::with_template("{spinner} [{elapsed_precise}] {wide_msg}")?);
    Ok(bar)
}

fn tell(bar: &ProgressBar, at: &str) -> ControlFlow<()> {
    bar.set_message(at.to_owned());
    bar.tick();
    ControlFlow::Continue(())
}

/// Writes NAME.md, whose blocks are still empty, and NAME.csv.
fn write_report(out: &Path, name: &str, markdown: &str, csv: &str) -> Result<(), Box<dyn Error>> {
    write_atomically(&out.join(format!("{name}.csv")), csv)?;
    write_atomically(&out.join(format!("{name}.md")), markdown)
}

/// Draws the pictures of a figure from its CSV and fills the blocks of its report.
fn redraw(out: &Path, name: &str) -> Drawn {
    let mut pictures = numbers::pictures(&format!("{name}.csv"), out)?;
    if name == "detail" {
        pictures.extend(numbers::pictures("detail-parts.csv", out)?);
    }
    finish(out, name, pictures)
}

/// Writes pictures, fills the blocks of the report, and prints where that is; returns the names of
/// the pictures.
fn finish(out: &Path, name: &str, pictures: Vec<(String, String)>) -> Drawn {
    let names = fill(out, name, pictures)?;
    print_place(out, name)?;
    Ok(names)
}

/// The same without a word.
fn fill(out: &Path, name: &str, pictures: Vec<(String, String)>) -> Drawn {
    for (name, svg) in &pictures {
        write_atomically(&out.join(name), svg)?;
    }
    write_numbers_of(&out.join(format!("{name}.md")), out)?;
    Ok(pictures.into_iter().map(|(name, _)| name).collect())
}

fn print_place(out: &Path, name: &str) -> Result<(), Box<dyn Error>> {
    Ok(writeln!(io::stdout().lock(), "{}", out.join(format!("{name}.md")).display())?)
}

fn write_numbers(args: &TablesArgs) -> Result<(), Box<dyn Error>> {
    for page in numbers::pages(&args.out)?.iter().chain(&args.pages) {
        write_numbers_of(page, &args.out)?;
    }
    Ok(())
}

/// Fills the blocks of a page from the CSV files of a folder.
fn write_numbers_of(page: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    let old = cli::read(page)?;
    let new = numbers::written_again(&old, folder).map_err(|error| format!("{}: {error}", page.display()))?;
    if new != old {
        write_atomically(page, &new)?;
    }
    Ok(())
}

fn run_table1(meshes: &Path, out: &Path, quick: bool) -> Drawn {
    make_folder(out)?;
    let table = watched(|progress| table1(meshes, quick, progress))?;
    write_report(out, "table1", &table.markdown(), &table.csv())?;
    finish(out, "table1", table.pictures()?)
}

fn redraw_table1(meshes: &Path, out: &Path) -> Drawn {
    let csv = cli::read(&out.join("table1.csv"))?;
    let table = watched(|progress| Table1::fitted_again(&csv, meshes, progress))?;
    finish(out, "table1", table.pictures()?)
}

/// Makes a table under a spinner.
fn watched(
    make: impl FnOnce(&mut dyn FnMut(&Table1Progress) -> ControlFlow<()>) -> Result<Table1, Table1Error>,
) -> Result<Table1, Box<dyn Error>> {
    let bar = bar()?;
    let table = make(&mut |progress| {
        let Table1Progress { done, cells, at } = progress;
        tell(&bar, &format!("{} of {cells}: {at}", done + 1))
    })?;
    bar.finish_and_clear();
    Ok(table)
}
