//! `sublevel hierarchy`.

use super::files::read_obstacle;
use super::poses::PoseArgs;
use super::progress::progress_bar;
use super::push;
use super::remote::{connect, interrupted};
use crate::body::Obstacle;
use crate::client::{Client, JobProgress};
use crate::jobs::solve;
use crate::measure::Pose;
use crate::store::{HierarchyMeasure, HierarchyOutcome, HierarchyRequest, HierarchySet};
use indicatif::ProgressBar;
use serde::Serialize;
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::PathBuf;
use tokio::runtime::Runtime;

/// Bracket the distance of two sets that need not be convex
///
/// Where both sets are convex, 'measure' takes a microsecond and is exact. Sos-bodies ('fit
/// --relax-convexity') need not be, and for them this command solves a semidefinite program of
/// Lasserre's hierarchy: milliseconds at level 0 and up to minutes at level 2, so it is for offline
/// work, such as checking where two hollow objects fit into each other, and not for a control loop.
///
/// Prints a proven bracket of the Euclidean distance, metres, or with '--measure level-distance' of
/// d(A||B) = min p_A over B, dimensionless. Level 0 is exact for convex bodies; of other sets the
/// lower bound may be too low (0 if nothing is known), and rises with the level: take the next one
/// where the bracket is too wide. The upper bound is the value at points that are proven to lie in
/// the sets; 'exact' says that both bounds are the same, to 1e-5 of the size of the sets, or of a
/// level distance. Points are in A's frame; of a level distance both are the one of B.
///
/// Of compounds bracket the parts one by one. With --server a server does the same, as a job of its
/// HierarchyService for each pose.
///
/// Examples:
///
/// sublevel hierarchy ring-d4-c10.json mug-d6-cinf.json --pose 0.5,0,0 --level 1
///
/// sublevel hierarchy ring-d4-c10.json mug-d6-cinf.json --server http://127.0.0.1:50051
#[derive(Debug, clap::Args)]
pub(super) struct HierarchyArgs {
    /// File of A, a body or an sos-body
    a: PathBuf,
    /// File of B
    b: PathBuf,
    #[command(flatten)]
    at: PoseArgs,
    /// What to bracket
    #[arg(long, value_enum, default_value_t = Bracketed::Distance)]
    measure: Bracketed,
    /// Level of the hierarchy: 0, 1 or 2; each takes ten to a hundred times as long as the one
    /// before
    #[arg(long, value_name = "LEVEL", default_value_t = 0)]
    level: usize,
    /// Have this server solve, such as http://127.0.0.1:50051: both files are stored there first
    ///
    /// Jobs wait for their turn there and survive its restart. Ctrl-C cancels the one that is under
    /// way, and no further pose is solved.
    #[arg(long, value_name = "URL")]
    server: Option<String>,
    /// Print one JSON object a line instead of a table
    #[arg(long)]
    json: bool,
}

/// What can be bracketed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Bracketed {
    /// Euclidean distance, metres
    Distance,
    /// Level distance d(A‖B), dimensionless
    LevelDistance,
}

impl From<Bracketed> for HierarchyMeasure {
    fn from(measure: Bracketed) -> Self {
        match measure {
            Bracketed::Distance => Self::Distance,
            Bracketed::LevelDistance => Self::LevelAOnB,
        }
    }
}

/// One pose's bracket; bounds have the unit of the measure.
#[derive(Serialize)]
struct Line {
    lower: f64,
    upper: Option<f64>,
    is_exact: bool,
    level: usize,
    point_a_m: Option<[f64; 3]>,
    point_b_m: Option<[f64; 3]>,
    iterations: usize,
    seconds: f64,
}

impl Line {
    fn new(level: usize, outcome: HierarchyOutcome) -> Self {
        let HierarchyOutcome { lower, upper, points_m, is_exact, iterations, seconds } = outcome;
        let [point_a_m, point_b_m] = [0, 1].map(|index: usize| points_m.map(|points| points[index]));
        Self { lower, upper, is_exact, level, point_a_m, point_b_m, iterations, seconds }
    }
}

/// What solves.
enum Solver {
    /// This program.
    Here,
    /// A server, which has both sets.
    There(Runtime, Client),
}

impl Solver {
    /// Stores the sets in the server, if there is one.
    fn new(args: &HierarchyArgs) -> Result<Self, Box<dyn Error>> {
        let Some(url) = &args.server else { return Ok(Self::Here) };
        push::store(url, &[args.a.clone(), args.b.clone()])?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
        let client = runtime.block_on(connect(url))?;
        Ok(Self::There(runtime, client))
    }

    /// The bracket at a pose, which has this number.
    fn solve(
        &self,
        request: &HierarchyRequest,
        sets: &[Obstacle; 2],
        (bar, number): (&ProgressBar, usize),
    ) -> Result<HierarchyOutcome, Box<dyn Error>> {
        match self {
            Self::Here => Ok(solve(request, sets, &mut |said| {
                bar.set_message(format!("pose {number}, step {}", said.iterations));
                ControlFlow::Continue(())
            })?),
            Self::There(runtime, client) => {
                let tell = |job: &JobProgress| bar.set_message(describe(number, job));
                Ok(runtime.block_on(client.solve_hierarchy(request, tell, interrupted()))?)
            }
        }
    }
}

fn describe(number: usize, JobProgress { id, progress }: &JobProgress) -> String {
    match progress {
        None => format!("pose {number}, job {id} waits for its turn"),
        Some(progress) => format!("pose {number}, job {id}, step {}", progress.iterations),
    }
}

/// Solves and prints, pose by pose.
pub(super) fn run(args: &HierarchyArgs) -> Result<(), Box<dyn Error>> {
    let trajectories = args.at.trajectories()?;
    let sets = [read_obstacle(&args.a)?, read_obstacle(&args.b)?];
    let ids = sets.each_ref().map(|set| *set.id());
    let solver = Solver::new(args)?;
    let bar = progress_bar(&format!("{} and {}", sets[0].name(), sets[1].name()));
    let mut out = io::stdout().lock();
    for (index, pose) in trajectories.iter().flatten().enumerate() {
        let number = index + 1;
        let at = |index: usize, pose| HierarchySet { body: ids[index], pose };
        let request = HierarchyRequest {
            measure: args.measure.into(),
            sets: [at(0, Pose::identity()), at(1, *pose)],
            level: args.level,
        };
        let named =
            |error: Box<dyn Error>| format!("{}, {}, pose {number}: {error}", args.a.display(), args.b.display());
        let line = Line::new(args.level, solver.solve(&request, &sets, (&bar, number)).map_err(named)?);
        bar.suspend(|| print(&mut out, number, &line, args.json))?;
    }
    bar.finish_and_clear();
    Ok(())
}

fn print(out: &mut impl Write, number: usize, line: &Line, json: bool) -> Result<(), Box<dyn Error>> {
    if json {
        serde_json::to_writer(&mut *out, line)?;
        return Ok(writeln!(out)?);
    }
    if number == 1 {
        writeln!(out, "{:>5}  {:>14}  {:>14}  exact  level  steps  seconds", "pose", "lower", "upper")?;
    }
    writeln!(
        out,
        "{number:>5}  {:>14}  {:>14}  {:>5}  {:>5}  {:>5}  {:>7.2}",
        if line.lower > f64::MIN { format!("{:.9}", line.lower) } else { "-".to_owned() },
        line.upper.map_or_else(|| "-".to_owned(), |upper| format!("{upper:.9}")),
        if line.is_exact { "yes" } else { "no" },
        line.level,
        line.iterations,
        line.seconds
    )?;
    Ok(())
}
