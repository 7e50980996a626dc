//! The rungs of a pair: model errors, gaps, iterations, times.

use super::effort::Effort;
use super::questions::{Settled, THRESHOLDS, ask, settle};
use crate::comparison::sweep::{Answer, Row};
use crate::comparison::{ComparisonError, FitCache, Hulls, Subject, motion, parry_pose};
use sublevel::body::{Body, Shape};
use sublevel::fit::{FitError, FitOptions, ball};
use sublevel::measure::{Distance, Options, Pose, WarmStart, distance, distance_batch};

/// Names of the rungs.
pub(super) const RUNGS: [&str; 5] = ["ball", "ellipsoid", "degree 4", "degree 6", "degree 8"];

/// A rung of a pair.
#[derive(Clone, Debug)]
pub(super) struct Rung {
    pub(super) name: &'static str,
    /// Mean and largest model error over the poses, as parts of the larger diameter.
    pub(super) error: [f64; 2],
    /// Proven gaps of both bodies together, as a part of the larger diameter.
    pub(super) gap: f64,
    /// Of queries without a hint and with one: mean iterations, and nanoseconds; and nanoseconds in
    /// a batch.
    pub(super) iterations: [f64; 2],
    pub(super) nanoseconds: [f64; 2],
    pub(super) batch: f64,
    /// Queries that did not converge, and brackets that do not hold the distance of the hulls once
    /// widened by the gaps.
    pub(super) failed: usize,
    pub(super) wrong: usize,
    /// For each of [`THRESHOLDS`].
    pub(super) settled: Vec<Settled>,
}

/// The rungs of a pair.
#[derive(Clone, Debug)]
pub(super) struct Ladder {
    pub(super) pair: String,
    pub(super) diameter_m: f64,
    pub(super) queries: usize,
    pub(super) rungs: Vec<Rung>,
}

/// Distances may contradict parry's by as much, relative to the larger diameter.
const AGREEMENT: f64 = 1e-7;

/// Measures a pair.
pub(super) fn ladder(
    [a, b]: [&Subject; 2],
    effort: &Effort,
    cache: &FitCache,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Ladder, ComparisonError> {
    let pair = format!("{}-{}", a.name, b.name);
    let diameter_m = a.diameter_m.max(b.diameter_m);
    let names = if effort.quick { &RUNGS[..4] } else { &RUNGS[..] };
    let mut bodies = Vec::new();
    for (rung, &name) in names.iter().enumerate() {
        announce(&format!("{pair}: {name}"))?;
        bodies.push((name, body(a, rung, cache)?, body(b, rung, cache)?));
    }
    let hulls = Hulls::new(&a.hull, &b.hull)?;
    announce(&format!("{pair}: poses"))?;
    let all: Vec<(&Body, &Body)> = bodies.iter().map(|(_, a, b)| (a, b)).collect();
    let poses = motion::separated(&all, 0.5 * diameter_m, effort.trajectories, effort.poses)?;
    let truth: Vec<f64> = poses.iter().flatten().map(|pose| hulls.distance(&parry_pose(pose))).collect();
    let mut rows: Vec<[Row<'_>; 3]> = all.iter().map(|(a, b)| timed(a, b, &poses)).collect();
    for pass in 0..effort.passes {
        announce(&format!("{pair}: pass {} of {}", pass + 1, effort.passes))?;
        rows.iter_mut().flatten().for_each(Row::turn);
    }
    let mut rungs = Vec::new();
    for ((name, a, b), [cold, warm, batch]) in bodies.iter().zip(&rows) {
        let gaps = [a, b].map(|body| body.gap_m().unwrap_or(f64::NAN));
        let (mut sum, mut most, mut wrong) = (0.0, 0.0_f64, 0);
        for (pose, truth) in poses.iter().flatten().zip(&truth) {
            let found = query(a, b, pose, &mut WarmStart::default());
            let error = (truth - found.value()) / diameter_m;
            (sum, most) = (sum + error, most.max(error));
            let upper = found.hulls_upper(a, b).unwrap_or(f64::NAN);
            let slack = AGREEMENT * diameter_m;
            wrong += usize::from(!(found.lower <= truth + slack && *truth <= upper + slack));
        }
        let mean = |row: &Row<'_>| row.tally.iterations().map_or(0.0, |(mean, ..)| mean);
        rungs.push(Rung {
            name,
            error: [sum / truth.len() as f64, most],
            gap: (gaps[0] + gaps[1]) / diameter_m,
            iterations: [mean(cold), mean(warm)],
            nanoseconds: [cold.nanoseconds(), warm.nanoseconds()],
            batch: batch.nanoseconds(),
            failed: cold.tally.failed + warm.tally.failed,
            wrong,
            settled: Vec::new(),
        });
    }
    for (index, part) in THRESHOLDS.into_iter().enumerate() {
        announce(&format!("{pair}: nearer than {part} diameters?"))?;
        let threshold_m = part * diameter_m;
        let asked = ask([a, b], &hulls, threshold_m, effort.questions, index as u64 + 1)?;
        for (rung, pair) in rungs.iter_mut().zip(&all) {
            rung.settled.push(settle(*pair, &asked, threshold_m));
        }
    }
    Ok(Ladder { pair, diameter_m, queries: truth.len(), rungs })
}

/// A rung of one object, counted from the ball.
fn body(subject: &Subject, rung: usize, cache: &FitCache) -> Result<Body, ComparisonError> {
    let Subject { name, mesh, .. } = subject;
    let failed = |what: String| ComparisonError::Representation { mesh: name, method: "ball".into(), what };
    if rung > 0 {
        return Ok(cache.body(name, mesh, &FitOptions { degree: 2 * rung, ..FitOptions::default() })?);
    }
    let made = || -> Result<Shape, FitError> { Ok(Shape::Body(Box::new(ball(name, &mesh.points)?.body))) };
    match cache.take(&format!("{name}-ball"), mesh, "ball", made)? {
        Shape::Body(body) => Ok(*body),
        Shape::Compound(_) => Err(failed("a compound is kept where a ball is looked for; delete it".into())),
    }
}

fn query(a: &Body, b: &Body, pose: &Pose, hint: &mut WarmStart) -> Distance {
    distance(a, &Pose::identity(), b, pose, &Options::default(), hint)
}

fn timed<'a>(a: &'a Body, b: &'a Body, poses: &'a [Vec<Pose>]) -> [Row<'a>; 3] {
    let judge = |found: &Distance| Answer::new(found.iterations, found.status, found.upper <= 0.0);
    let batch = move |poses: &[Pose], answers: &mut [Distance]| {
        // There are poses, and as many places.
        let _ = distance_batch(a, &Pose::identity(), b, poses, &Options::default(), answers);
    };
    [
        Row::cold("cold", poses, move |pose| judge(&query(a, b, pose, &mut WarmStart::default()))),
        Row::warm("warm", poses, move |pose, hint| judge(&query(a, b, pose, hint))),
        Row::batches("batch", poses, 1024, batch, judge),
    ]
}
