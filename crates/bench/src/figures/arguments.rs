//! What can be measured and drawn, as arguments of the command line.

use crate::stability::{Method, Share};
use clap::{Args, Parser, Subcommand};
use std::path::{Path, PathBuf};

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
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) figure: Figure,
}

#[derive(Debug, Subcommand)]
pub(super) enum Figure {
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
    Ablation(AblationArgs),
    #[command(hide = true)]
    Fit(FitArgs),
}

/// Fit one body: what the figure of cost watches for the memory that a fit takes
#[derive(Debug, Args)]
pub(super) struct FitArgs {
    pub(super) input: PathBuf,
    #[arg(long)]
    pub(super) degree: usize,
    #[arg(long)]
    pub(super) out: PathBuf,
}

/// All figures, one after the other, and charts.md, which shows the main ones and leads to the
/// others
///
/// Keep the machine quiet: times are measured. Takes about an hour on one core,
/// and under five minutes with --quick, once the fits are kept. Clarabel and coal take part as the
/// figures' own help says.
#[derive(Debug, Args)]
pub(super) struct AllArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// Volumes and construction times of all bounding sets around five meshes, beside the paper's Table
/// I
///
/// Builds balls, boxes and bodies of every objective and degree around the meshes 10 (human), 101
/// (chair), 121 (octopus), 181 (hand) and 361 (vase) of the Princeton Mesh Segmentation Benchmark.
/// Writes table1.md, table1.csv and the pictures table1*.svg. Takes about five minutes on one core.
#[derive(Debug, Args)]
pub(super) struct Table1Args {
    /// Folder with 10.off, 101.off, 121.off, 181.off and 361.off
    #[arg(long, value_name = "DIR")]
    pub(super) meshes: PathBuf,
    /// Folder for the report; made with its parents when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-chart")]
    pub(super) out: PathBuf,
    /// Only up to degree 4: half a minute
    #[arg(long)]
    pub(super) quick: bool,
    /// Take volumes and times from the table1.csv that lies in the folder of the report; fit again
    /// only what the pictures show, and draw it
    #[arg(long, conflicts_with = "quick")]
    pub(super) redraw: bool,
}

/// What is lost without each stage of a search: switched off one at a time, over draws as those of
/// the endurance bench, other questions, the stability families and the named rescues
///
/// Writes ablation.csv and fills its blocks in the pages of --out; names what is rescued on the
/// standard output. Fails where a bracket is wrong without some stage. Needs a build whose stages
/// can be switched off, and whose times are not those of the library. Each query is solved some
/// five times.
///
/// cargo run --release -p sublevel-bench --features ablation -- ablation --queries 3e6 --out docs
#[derive(Debug, Args)]
pub(super) struct AblationArgs {
    /// Draws of distances and overlaps, such as 3e6; a tenth as many of other questions
    #[arg(long, value_name = "COUNT", default_value = "1e5", value_parser = count)]
    pub(super) queries: f64,
    /// Folder for the CSV, with the pages that show it; made with its parents when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-chart")]
    pub(super) out: PathBuf,
}

/// A number of queries.
fn count(text: &str) -> Result<f64, String> {
    let count: f64 = text.parse().map_err(|_| format!("'{text}' is not a number such as 1e5"))?;
    // A u64 that a double holds.
    if (10.0..=1e15).contains(&count) { Ok(count) } else { Err(format!("{text} is not between 10 and 1e15")) }
}

/// Write the numbers of pages again from the CSV files: nothing is measured
///
/// Blocks between `<!-- from FILE.csv: NAME -->` and `<!-- end -->` are replaced in all pages of
/// --out and in those that are named.
///
/// sublevel-bench tables --out docs README.md
#[derive(Debug, Args)]
pub(super) struct TablesArgs {
    /// Folder with the CSV files and their pages
    #[arg(long, value_name = "DIR", default_value = "docs")]
    pub(super) out: PathBuf,
    /// Pages elsewhere that show numbers of these CSV files
    pub(super) pages: Vec<PathBuf>,
}

/// Time of a distance query against model error: our representations beside hulls, simplified hulls
/// and meshes of parry and coal
///
/// Pairs of the five meshes of the Princeton benchmark and of household objects. Writes speed.md,
/// speed.csv and the pictures speed*.svg. Fits are made once and kept, which takes a few minutes on
/// one core; measuring takes about a quarter of an hour. Coal takes part when SUBLEVEL_COAL names
/// the program that times it.
#[derive(Debug, Args)]
pub(super) struct SpeedArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// Time and iterations of queries with a hint against how far the pose before is away; and the
/// paper's experiment
///
/// Steps from a 10 000th of half the larger diameter to poses that have nothing to do with each
/// other; then the chair swept past the human, level distances and their times beside the paper's.
/// Writes warm.md, warm.csv and the pictures warm*.svg.
#[derive(Debug, Args)]
pub(super) struct WarmArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// What each rung of the ladder buys: model error, gap, iterations, time, and how many questions it
/// settles; and convex parts
///
/// The rungs are ball, ellipsoid and degree 4, 6, 8; the question is "nearer than m?" of random
/// pairs, m from touching to ten object sizes. Writes detail.md, detail.csv, detail-parts.csv and
/// the pictures detail*.svg. Convex parts are compared with parry's V-HACD.
#[derive(Debug, Args)]
pub(super) struct DetailArgs {
    #[command(flatten)]
    pub(super) common: Common,
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
pub(super) struct StabilityArgs {
    /// Folder for the report; made with its parents when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-chart")]
    pub(super) out: PathBuf,
    /// A tenth of the cases: under a minute
    #[arg(long)]
    pub(super) quick: bool,
    /// Only these columns: cold, warm, batch, newton, slsqp, clarabel, parry, coal
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    pub(super) methods: Vec<Method>,
    /// Fail, with the row named, where ours fails more often than in this stability.csv of an
    /// earlier run
    #[arg(long, value_name = "FILE")]
    pub(super) guard: Option<PathBuf>,
    /// Put one case here and now, and print what came of it: the number of its family, the method
    /// and the seed, FROM-TO for several
    #[arg(long, value_name = "FAMILY/METHOD/SEED", conflicts_with_all = ["out", "quick", "guard", "methods"])]
    pub(super) replay: Option<Share>,
    /// With --replay, print one JSON object per case
    #[arg(long, requires = "replay")]
    pub(super) json: bool,
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
pub(super) struct AccuracyArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// How time and memory grow: queries with degree, constraints, parts and poses of a batch, bodies
/// with their degree, messages with their pairs, fits with degree and points
///
/// Chair and human of the Princeton benchmark; a server on loopback in this process; fits of up to
/// a million random points. Exponents stand beside the curves. Writes cost.md, cost.csv and the
/// pictures cost*.svg.
#[derive(Debug, Args)]
pub(super) struct CostArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// What the server adds to the library, and how scenes grow: calls beside the same question in
/// process, ticks of up to 100 000 objects, poses at 1 kHz, forks, ladders
///
/// A server on loopback in this process, on all cores; the robot and problems are those of
/// DIR/panda. Writes scenes.md, scenes.csv and scenes-ticks.svg.
#[derive(Debug, Args)]
pub(super) struct ScenesArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// Pairs by type: ball, ellipsoid, degree 4, 6 and 8, slab-cut, box, cylinder, capsule and
/// half-space, each against each: distances cold and warm, and decisions, beside coal and parry
///
/// Shapes about the chair and the human of the Princeton benchmark. Writes pairs.md, pairs.csv and
/// pairs-*.svg. Takes about a minute on one core, once the fits are kept; a second with --quick.
/// Coal takes part when SUBLEVEL_COAL names the program that times it.
#[derive(Debug, Args)]
pub(super) struct PairsArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// A planner's workload: states and motions of a Franka Emika Panda among boxes and cylinders, µs
/// per state and per radian against the free states that are kept
///
/// Links as spheres, ellipsoids, bodies of degree 4 and 6, ladders, compounds, and what `sublevel
/// robot` fits, in process and over gRPC in batches of 1 000; motions proven and sampled. The robot
/// and problems are those of DIR/panda. Writes panda.md, panda.csv and panda-*.svg. Fits are made
/// once and kept, which takes some minutes on one core; measuring takes about ten minutes, one with
/// --quick. Coal takes part when SUBLEVEL_COAL_PANDA names the program that times it on states of
/// this robot.
#[derive(Debug, Args)]
pub(super) struct PandaArgs {
    #[command(flatten)]
    pub(super) common: Common,
    /// Other problems, in the format of DIR/panda/panda_problems.json
    #[arg(long, value_name = "FILE", conflicts_with = "redraw")]
    pub(super) problems: Option<PathBuf>,
    /// Print the numbers as one JSON object instead of the place of the report
    #[arg(long, conflicts_with = "redraw")]
    pub(super) json: bool,
}

/// Time of a fit against the volume of its body: by each solver, refined, and over the smaller
/// cones
///
/// The five meshes of the paper's Table I at degrees 2 to 8. Writes fits.md, fits.csv and fits.svg.
/// Takes about ten minutes on one core, most of them for degree 8 by clarabel; a minute with
/// --quick, which ends at degree 6.
#[derive(Debug, Args)]
pub(super) struct FitsArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// Sets that need not be convex: brackets against time by branch and bound and by the hierarchy,
/// and models of objects beside compounds and convex bodies
///
/// Random pairs of degree 4 and 6; mug, wingnut, octopus, chair and hand. Writes sets.md, sets.csv
/// and sets*.svg. Takes about ten minutes on one core, once the fits are kept; a minute with
/// --quick.
#[derive(Debug, Args)]
pub(super) struct SetsArgs {
    #[command(flatten)]
    pub(super) common: Common,
}

/// What all figures with bodies around meshes take.
#[derive(Debug, Args)]
pub(super) struct Common {
    /// Folder with psb/101.off, meshes/mbm_mug.off and so on
    #[arg(long, value_name = "DIR", required_unless_present = "redraw")]
    pub(super) data: Option<PathBuf>,
    /// Folder for the report; made with its parents when it is not there
    #[arg(long, value_name = "DIR", default_value = "sublevel-chart")]
    pub(super) out: PathBuf,
    /// Folder where fits are kept between runs; delete it after changes to the fit
    #[arg(long, value_name = "DIR", default_value = "target/bench-bodies")]
    pub(super) fits: PathBuf,
    /// Fewer objects, representations and poses: a look, not a result
    #[arg(long)]
    pub(super) quick: bool,
    /// Measure nothing: draw the pictures and write the tables again from the CSV that an earlier
    /// run left in the folder of the report
    #[arg(long, conflicts_with_all = ["quick", "data"])]
    pub(super) redraw: bool,
}

impl Common {
    /// The folder; only `--redraw` does without.
    pub(super) fn data(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new(""))
    }
}
