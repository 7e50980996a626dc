//! `sublevel measure`.

mod query;
mod scene_pair;
mod timing;
mod undefined;

use super::files::read_geometry;
use super::poses::PoseArgs;
use crate::measure::{DEFAULT_ACCURACY, Distance, LevelDistance, Options, Pose, Status, WarmStart};
use query::Query;
use scene_pair::ScenePair;
use serde::Serialize;
use std::error::Error;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;
use undefined::Undefined;

/// Measure distances between two objects, without a server
///
/// Prints the Euclidean distance and both level distances d(A‖B) = min p_A on B and d(B‖A), each
/// with its proven bracket, for one relative pose or for each pose of a file. Successive poses of a
/// trajectory are warm-started.
///
/// A pose maps the frame of B into the frame of A; witnesses and normal are in A's frame, metres,
/// the normal from B to A (none on overlap). With --json the convex hulls of the objects have a
/// bracket, too, where the bodies' gaps are known: their distance is at least distance_lower_m and
/// at most hulls_distance_upper_m (of a compound it is the hulls of its pieces). Level distances
/// are above 1 apart, 1 touching, below 1 overlapping, and use the polynomials as they are stored:
/// 'show' prints their minimum.
///
/// Of ladders the finest rung is measured. Sos-bodies, which need not be convex, are measured by
/// dividing boxes, in milliseconds: the bracket of the distance, whether the two overlap, and both
/// level distances. Capsules and half-spaces have a distance and an overlap, and no level distances
/// (-). Of a half-space the distance is 0 wherever the other object reaches into it.
///
/// Examples:
///
/// sublevel measure a.json b.json --pose 0.5,0,0,0,0,0,1
///
/// sublevel measure ring-d4-c10.json mug.json --pose 0.5,0,0 --accuracy 1e-4
#[derive(Debug, clap::Args)]
pub(super) struct MeasureArgs {
    /// File of A: a body, compound, ladder, sos-body, capsule or half-space
    a: PathBuf,
    /// File of B
    b: PathBuf,
    #[command(flatten)]
    at: PoseArgs,
    /// Width asked of the brackets: relative to the smaller body's circumradius, and to max(1, |d|)
    /// [default: 1e-9, with an sos-body 1e-3]
    #[arg(long, value_name = "WIDTH")]
    accuracy: Option<f64>,
    /// Print one JSON object a line instead of a table
    #[arg(long)]
    json: bool,
    /// Print instead one JSON object of nanoseconds per query, cold and warm, and of distances in
    /// batches of up to 1024 poses: medians of 9 passes over the poses, everything a JSON line
    /// holds included; warm starts are cold at each trajectory. 'level' is d(A‖B)
    #[arg(long)]
    time: bool,
}

/// One pose's answers.
#[derive(Serialize)]
struct Line {
    status: &'static str,
    distance_m: f64,
    distance_lower_m: f64,
    distance_upper_m: f64,
    /// Of the distance of the convex hulls of the objects, if both bodies tell how far they reach
    /// beyond them; of the lower bound it is the same.
    hulls_distance_upper_m: Option<f64>,
    level_ab: f64,
    level_ab_lower: Option<f64>,
    level_ab_upper: f64,
    level_ba: f64,
    level_ba_lower: Option<f64>,
    level_ba_upper: f64,
    witness_a: [f64; 3],
    witness_b: [f64; 3],
    normal: Option<[f64; 3]>,
    /// Of the distance.
    iterations: u32,
}

impl Line {
    fn new(distance: &Distance, ab: &LevelDistance, ba: &LevelDistance, hulls_upper: Option<f64>) -> Self {
        let converged = [distance.status, ab.status, ba.status].iter().all(|&status| status == Status::Converged);
        let finite = |value: f64| value.is_finite().then_some(value);
        Self {
            status: if converged { "converged" } else { "bracket_wide" },
            distance_m: distance.value(),
            distance_lower_m: distance.lower,
            distance_upper_m: distance.upper,
            hulls_distance_upper_m: hulls_upper,
            level_ab: ab.value(),
            level_ab_lower: finite(ab.lower),
            level_ab_upper: ab.upper,
            level_ba: ba.value(),
            level_ba_lower: finite(ba.lower),
            level_ba_upper: ba.upper,
            witness_a: distance.witness_a.into(),
            witness_b: distance.witness_b.into(),
            normal: distance.normal.map(Into::into),
            iterations: distance.iterations,
        }
    }
}

/// Measures and prints.
pub(super) fn run(args: &MeasureArgs) -> Result<(), Box<dyn Error>> {
    let trajectories = args.at.trajectories()?;
    let sides = [read_geometry(&args.a)?, read_geometry(&args.b)?];
    let mut out = BufWriter::new(io::stdout().lock());
    if let [Some(a), Some(b)] = sides.each_ref().map(|side| side.rungs().last().cloned()) {
        let accuracy = args.accuracy.unwrap_or(DEFAULT_ACCURACY);
        let options = Options::default().with_accuracy(accuracy).map_err(|error| format!("--accuracy: {error}"))?;
        solids(args, &Query { a, b, options }, &trajectories, &mut out)?;
    } else {
        let named = |error: Box<dyn Error>| format!("{}, {}: {error}", args.a.display(), args.b.display());
        if args.time {
            return Err(named(Undefined::Time.into()).into());
        }
        let pair = ScenePair::new(&sides, args.accuracy).map_err(named)?;
        objects(args, &pair, &trajectories, &mut out)?;
    }
    Ok(out.flush()?)
}

/// Two bodies or compounds.
fn solids(
    args: &MeasureArgs,
    query: &Query,
    trajectories: &[Vec<Pose>],
    out: &mut impl Write,
) -> Result<(), Box<dyn Error>> {
    if args.time {
        serde_json::to_writer(&mut *out, &timing::time(query, trajectories))?;
        return Ok(writeln!(out)?);
    }
    if !args.json {
        writeln!(
            out,
            "{:>5}  {:>14}  {:>8}  {:>14}  {:>8}  {:>14}  {:>8}  status",
            "pose", "distance m", "± m", "d(A‖B)", "±", "d(B‖A)", "±"
        )?;
    }
    let mut number = 0;
    for trajectory in trajectories {
        let mut warm = [WarmStart::default(); 3];
        for pose in trajectory {
            let distance = query.distance(pose, &mut warm[0]);
            let (ab, ba) = (query.level_ab(pose, &mut warm[1]), query.level_ba(pose, &mut warm[2]));
            let line = Line::new(&distance, &ab, &ba, distance.hulls_upper(&*query.a, &*query.b));
            if args.json {
                serde_json::to_writer(&mut *out, &line)?;
                writeln!(out)?;
            } else {
                number += 1;
                writeln!(
                    out,
                    "{number:>5}  {:>14.9}  {:>8.1e}  {:>14.9}  {:>8.1e}  {:>14.9}  {:>8.1e}  {}",
                    line.distance_m,
                    distance.upper - distance.lower,
                    line.level_ab,
                    ab.upper - ab.lower,
                    line.level_ba,
                    ba.upper - ba.lower,
                    line.status
                )?;
            }
        }
    }
    Ok(())
}

/// Two objects of which one is no body or compound.
fn objects(
    args: &MeasureArgs,
    pair: &ScenePair,
    trajectories: &[Vec<Pose>],
    out: &mut impl Write,
) -> Result<(), Box<dyn Error>> {
    if !args.json {
        writeln!(out, "{}", scene_pair::head())?;
    }
    for (index, pose) in trajectories.iter().flatten().enumerate() {
        let line = pair.measure(pose)?;
        if args.json {
            serde_json::to_writer(&mut *out, &line)?;
            writeln!(out)?;
        } else {
            writeln!(out, "{}", line.row(index + 1))?;
        }
    }
    Ok(())
}
