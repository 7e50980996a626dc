//! Counts the instructions of solves under valgrind's callgrind, which a busy machine does not
//! change.
//!
//! `.ci/instructions` runs it: each row in a process of its own, on the AVX2 path (valgrind knows
//! no AVX-512), on three fitted bodies kept beside this file and on shapes, in poses that
//! depend on nothing. The counts are compared with those recorded in `benches/instructions.json`;
//! they belong to one version of the compiler, which is recorded with them.

use clap::Parser;
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::error::Error;
use std::f64::consts::TAU;
use std::fs;
use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use sublevel::body::Body;
use sublevel::fit::shapes;
use sublevel::fit::{FitOptions, fit};
use sublevel::measure::{
    Capsule, Decision, Options, Pose, Status, WarmStart, distance, distance_to_capsule, level_distance, overlap,
};

/// Solves per row.
const SOLVES: usize = 1000;

/// Part by which a count may exceed the recorded one.
const TOLERANCE: f64 = 0.03;

/// The middle of the human, metres: its origin is between its feet.
const MIDDLE: Vector3<f64> = Vector3::new(0.0, 0.0, 0.9);

/// A counted solve: what it returns is whether it converged, and its iterations.
type Solve = fn(&Bodies, &Pose, &mut WarmStart) -> (Status, u32);

/// Where the bodies of a row stand.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Where {
    /// Apart, all of them.
    Apart,
    /// The chair and the human, moved along the normal to a centimetre from contact or less, on
    /// either side by turns.
    NearHuman,
    /// The chair and the box, likewise.
    NearBox,
    /// The chair and the human that slabs cut, likewise.
    NearCut,
}

use Where::{Apart, NearBox, NearCut, NearHuman};

/// The rows; those that are not warm forget the pose before.
const ROWS: [(&str, bool, Where, Solve); 16] = [
    ("distance_warm", true, Apart, solve_distance),
    ("distance_cold", false, Apart, solve_distance),
    ("distance_near", false, NearHuman, solve_distance),
    ("level_distance_warm", true, Apart, solve_level_distance),
    ("level_distance_cold", false, Apart, solve_level_distance),
    ("box_warm", true, Apart, solve_box),
    ("box_cold", false, Apart, solve_box),
    ("box_near", false, NearBox, solve_box),
    ("two_boxes_cold", false, Apart, solve_boxes),
    ("capsule_warm", true, Apart, solve_capsule),
    ("cut_warm", true, Apart, solve_cut),
    ("cut_cold", false, Apart, solve_cut),
    ("cut_near", false, NearCut, solve_cut),
    ("overlap_apart", false, Apart, decide_overlap),
    ("overlap_near", false, NearHuman, decide_overlap),
    ("overlap_box_near", false, NearBox, decide_overlap_of_box),
];

/// Count the instructions of solves and compare them with the recorded counts
#[derive(Debug, Parser)]
#[command(name = "instructions", max_term_width = 100)]
struct Args {
    /// Record the counts instead of comparing them
    #[arg(long)]
    record: bool,
    /// Fit the bodies of benches/instructions again; record the counts afterwards
    #[arg(long)]
    fit: bool,
    /// Run the solves of one row, to be counted from outside
    #[arg(long, value_name = "ROW", hide = true)]
    run: Option<String>,
    /// Given by cargo
    #[arg(long, hide = true)]
    bench: bool,
}

struct Bodies {
    chair: Body,
    human: Body,
    /// The human, cut by six slabs.
    cut: Body,
    /// About as large as the human, and as the chair.
    boxes: [Body; 2],
    capsule: Capsule,
}

/// What is recorded.
#[derive(Default, Serialize, Deserialize)]
struct Recorded {
    rustc: String,
    rows: BTreeMap<String, Count>,
}

/// Means over the solves of a row.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Count {
    instructions: u64,
    iterations: f64,
}

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let args = Args::parse();
    if let Some(row) = args.run {
        return run(&row).map(|()| ExitCode::SUCCESS);
    }
    if args.fit {
        for (name, shape, slabs) in
            [("chair", shapes::chair(), 0), ("human", shapes::human(), 0), ("human-cut", shapes::human(), 6)]
        {
            let options = FitOptions { degree: 6, slabs, input: format!("{name}.off"), ..FitOptions::default() };
            let body = fit(name, &shape.vertices, &options, &mut |_| ControlFlow::Continue(()))?.body;
            write(&body_file(name), &body.to_json())?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    let rows =
        ROWS.iter().map(|(row, ..)| Ok(((*row).to_owned(), count(row)?))).collect::<Result<_, Box<dyn Error>>>()?;
    let counted = Recorded { rustc: rustc(), rows };
    if args.record {
        write(&recorded_file(), &(serde_json::to_string_pretty(&counted)? + "\n"))?;
    }
    let text = read(&recorded_file()).map_err(|error| format!("{error}; record the counts with --record"))?;
    Ok(if compare(&counted, &serde_json::from_str(&text)?) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Prints the counts beside the recorded ones; whether none is too high.
fn compare(counted: &Recorded, recorded: &Recorded) -> bool {
    println!("{:<22} {:>12} {:>12} {:>8} {:>11}", "per solve", "instructions", "recorded", "change", "iterations");
    let mut good = true;
    for (row, now) in &counted.rows {
        let Some(before) = recorded.rows.get(row) else {
            println!("{row:<22} {:>12} not recorded: run again with --record", now.instructions);
            good = false;
            continue;
        };
        let change = now.instructions as f64 / before.instructions as f64 - 1.0;
        let verdict = if !(change <= TOLERANCE) {
            good = false;
            "  TOO MANY"
        } else if change < -TOLERANCE {
            "  fewer: record it"
        } else {
            ""
        };
        println!(
            "{row:<22} {:>12} {:>12} {:>+7.1}% {:>11.3}{verdict}",
            now.instructions,
            before.instructions,
            100.0 * change,
            now.iterations
        );
    }
    if counted.rustc != recorded.rustc {
        println!(
            "recorded with {}, counted with {}: some of the change is the compiler's",
            recorded.rustc, counted.rustc
        );
    }
    good
}

/// Counts a row in a process of its own.
fn count(row: &str) -> Result<Count, Box<dyn Error>> {
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("callgrind.{row}"));
    // A count of an earlier run must not pass for this one's.
    if out.exists() {
        fs::remove_file(&out)?;
    }
    let output = Command::new("valgrind")
        .args(["--tool=callgrind", "--toggle-collect=*instructions::counted*"])
        .arg(format!("--callgrind-out-file={}", out.display()))
        .arg(std::env::current_exe()?)
        .args(["--run", row])
        .env("OPENBLAS_NUM_THREADS", "1")
        .output()
        .map_err(|error| format!("valgrind: {error}"))?;
    let errors = String::from_utf8_lossy(&output.stderr);
    if !output.status.success() {
        return Err(format!("{row} failed under valgrind:\n{errors}").into());
    }
    let iterations: u64 = String::from_utf8(output.stdout)?.trim().parse()?;
    let text = read(&out)?;
    let total = text.lines().find_map(|line| line.strip_prefix("totals:").or(line.strip_prefix("summary:")));
    let total: u64 = total.ok_or("callgrind wrote no total")?.trim().parse()?;
    if total == 0 {
        return Err("callgrind counted nothing: did the counted function lose its name?".into());
    }
    Ok(Count { instructions: total / SOLVES as u64, iterations: iterations as f64 / SOLVES as f64 })
}

/// Runs the solves of a row and prints the sum of their iterations.
fn run(row: &str) -> Result<(), Box<dyn Error>> {
    let (_, warm, place, solve) = ROWS.into_iter().find(|(known, ..)| *known == row).ok_or("--run: no such row")?;
    let load = |name: &str| -> Result<Body, Box<dyn Error>> { Ok(Body::from_json(&read(&body_file(name))?)?) };
    let capsule = Capsule::new(0.25, 0.65)?;
    let boxes = [
        Body::cuboid("locker", Vector3::new(0.25, 0.2, 0.9))?.moved(&UnitQuaternion::identity(), &MIDDLE)?,
        Body::cuboid("crate", Vector3::new(0.4, 0.4, 0.5))?,
    ];
    let bodies = Bodies { chair: load("chair")?, human: load("human")?, cut: load("human-cut")?, boxes, capsule };
    let mut poses = poses()?;
    let other = match place {
        NearBox => &bodies.boxes[0],
        NearCut => &bodies.cut,
        Apart | NearHuman => &bodies.human,
    };
    // Once uncounted, to see that each is what it is meant to be: bodies apart, and converged.
    for (k, pose) in poses.iter_mut().enumerate() {
        let to = |pose: &Pose| {
            let (options, mut warm) = (Options::default(), WarmStart::default());
            distance(&bodies.chair, &Pose::identity(), other, pose, &options, &mut warm)
        };
        let gap = to(pose);
        let apart = gap.normal.filter(|_| gap.lower > 0.0).ok_or_else(|| format!("{row}: not apart at {pose:?}"))?;
        if place != Apart {
            let (sign, wanted) = (if k % 2 == 0 { 1.0 } else { -1.0 }, 1e-4 * (1.0 + (k % 100) as f64));
            *pose = pose.with_translation(pose.translation() + apart * (gap.upper - sign * wanted));
            if (to(pose).lower > 0.0) != (sign > 0.0) {
                return Err(format!("{row}: on the other side of contact at {pose:?}").into());
            }
        }
        if solve(&bodies, pose, &mut WarmStart::default()).0 != Status::Converged {
            return Err(format!("{row}: not converged at {pose:?}").into());
        }
    }
    println!("{}", counted(&bodies, &poses, warm, solve));
    Ok(())
}

/// What callgrind counts, by its name; the sum of the iterations.
#[inline(never)]
fn counted(bodies: &Bodies, poses: &[Pose], warm: bool, solve: Solve) -> u64 {
    let mut kept = WarmStart::default();
    let mut iterations = 0;
    for pose in poses {
        if !warm {
            kept = WarmStart::default();
        }
        iterations += u64::from(solve(bodies, black_box(pose), &mut kept).1);
    }
    iterations
}

fn solve_distance(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    let answer = distance(&bodies.chair, &Pose::identity(), &bodies.human, pose, &Options::default(), warm);
    (answer.status, answer.iterations)
}

fn solve_level_distance(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    let answer = level_distance(&bodies.chair, &Pose::identity(), &bodies.human, pose, &Options::default(), warm);
    (answer.status, answer.iterations)
}

fn solve_box(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    let answer = distance(&bodies.chair, &Pose::identity(), &bodies.boxes[0], pose, &Options::default(), warm);
    (answer.status, answer.iterations)
}

fn solve_cut(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    let answer = distance(&bodies.chair, &Pose::identity(), &bodies.cut, pose, &Options::default(), warm);
    (answer.status, answer.iterations)
}

fn solve_boxes(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    let [locker, crate_] = &bodies.boxes;
    let answer = distance(crate_, &Pose::identity(), locker, pose, &Options::default(), warm);
    (answer.status, answer.iterations)
}

fn solve_capsule(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    let about = pose.with_translation(pose.transform_point(&MIDDLE));
    let options = Options::default();
    let answer = distance_to_capsule(&bodies.chair, &Pose::identity(), &bodies.capsule, &about, &options, warm);
    (answer.status, answer.iterations)
}

fn decide_overlap(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    decided(overlap(&bodies.chair, &Pose::identity(), &bodies.human, pose, &Options::default(), warm))
}

fn decide_overlap_of_box(bodies: &Bodies, pose: &Pose, warm: &mut WarmStart) -> (Status, u32) {
    decided(overlap(&bodies.chair, &Pose::identity(), &bodies.boxes[0], pose, &Options::default(), warm))
}

fn decided(answer: Decision) -> (Status, u32) {
    (if matches!(answer, Decision::Undecided { .. }) { Status::BracketWide } else { Status::Converged }, 0)
}

/// The human about the chair: round it at a varying distance, a centimetre a step, turning by a
/// degree a step about an axis that moves.
fn poses() -> Result<Vec<Pose>, Box<dyn Error>> {
    let mut rotation = UnitQuaternion::identity();
    (0..SOLVES)
        .map(|step| {
            let s = step as f64;
            let radius = 1.9 + 0.3 * (TAU * s / 370.0).sin();
            let (sin, cos) = (0.01 * s / 1.9).sin_cos();
            let middle = Vector3::new(radius * cos, radius * sin, 0.5 + 0.2 * (TAU * s / 230.0).sin());
            let axis = Vector3::new((TAU * s / 410.0).cos(), (TAU * s / 290.0).sin(), 0.7);
            rotation = UnitQuaternion::new(axis.normalize() * (TAU / 360.0)) * rotation;
            let translation = middle - rotation * MIDDLE;
            Ok(Pose::from_quaternion(translation, rotation.coords.into())?)
        })
        .collect()
}

fn rustc() -> String {
    let output = Command::new("rustc").arg("--version").output().ok();
    output.and_then(|output| String::from_utf8(output.stdout).ok()).unwrap_or_default().trim().to_owned()
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("benches")
}

fn recorded_file() -> PathBuf {
    folder().join("instructions.json")
}

fn body_file(name: &str) -> PathBuf {
    folder().join(format!("instructions/{name}-d6.json"))
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}
