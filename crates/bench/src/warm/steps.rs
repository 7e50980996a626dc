//! Time and iterations against how far the pose before is away.

use super::effort::Effort;
use crate::comparison::sweep::{Answer, Row};
use crate::comparison::{Coal, ComparisonError, FitCache, Hulls, PeerShape, Subject, motion, parry_pose};
use sublevel::body::Body;
use sublevel::fit::FitOptions;
use sublevel::measure::{Distance, Options, Pose, WarmStart, distance};

/// Who answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    /// Bodies of a degree.
    Degree(usize),
    /// Coal's GJK on the hulls.
    Coal,
    /// Parry's.
    Parry,
}

/// One solver at one step size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) who: Who,
    /// In units of half of the larger diameter; none for unrelated poses.
    pub(super) step: Option<f64>,
    /// Nanoseconds per query.
    pub(super) cold: f64,
    pub(super) warm: f64,
    /// Mean and largest number of iterations, cold and warm, where they are reported.
    pub(super) cold_iterations: Option<(f64, u32)>,
    pub(super) warm_iterations: Option<(f64, u32)>,
    /// Queries that did not converge, and those whose brackets with and without a hint exclude each
    /// other.
    pub(super) failed: usize,
    pub(super) contradictions: usize,
}

/// A pair at all step sizes.
pub(super) struct Steps {
    pub(super) pair: String,
    /// Metres of a step of 1.
    pub(super) unit_m: f64,
    pub(super) queries: usize,
    pub(super) cells: Vec<Cell>,
}

/// Measures a pair.
pub(super) fn steps(
    [a, b]: [&Subject; 2],
    (degrees, sizes): (&[usize], &[Option<f64>]),
    effort: &Effort,
    (cache, coal): (&FitCache, Option<&Coal>),
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Steps, ComparisonError> {
    let pair = format!("{}-{}", a.name, b.name);
    let unit_m = 0.5 * a.diameter_m.max(b.diameter_m);
    let mut bodies = Vec::new();
    for &degree in degrees {
        announce(&format!("{pair}: degree {degree}"))?;
        let options = FitOptions { degree, ..FitOptions::default() };
        bodies.push((degree, cache.body(a.name, &a.mesh, &options)?, cache.body(b.name, &b.mesh, &options)?));
    }
    let hulls = Hulls::new(&a.hull, &b.hull)?;
    let mut cells = Vec::new();
    for &step in sizes {
        announce(&format!("{pair}: steps of {step:?}"))?;
        // The widest bodies are those of the lowest degree: all others are apart with them.
        let Some((_, wide_a, wide_b)) = bodies.first() else { continue };
        let poses = motion::stepping((wide_a, wide_b), unit_m, step, effort.trajectories, effort.poses)?;
        let parry_poses: Vec<Vec<_>> = poses.iter().map(|t| t.iter().map(parry_pose).collect()).collect();
        let mut rows: Vec<(Who, [Row<'_>; 2])> =
            bodies.iter().map(|(degree, a, b)| (Who::Degree(*degree), ours(a, b, &poses))).collect();
        let parry = [
            Row::cold("cold", &parry_poses, |pose| hulls.cold(pose)),
            Row::warm("warm", &parry_poses, |pose, kept| hulls.warm(pose, kept)),
        ];
        rows.push((Who::Parry, parry));
        let name = format!("warm-{pair}-{}", step.map_or("teleport".to_owned(), |step| format!("{step:e}")));
        let mut run = coal
            .map(|coal| coal.start(cache.folder(), &name, [a, b].map(|of| PeerShape::Hull(&of.hull)), &poses))
            .transpose()?;
        for _ in 0..effort.passes {
            if let Some(run) = &mut run {
                run.pass()?;
            }
            rows.iter_mut().for_each(|(_, both)| both.iter_mut().for_each(Row::turn));
        }
        for (who, [cold, warm]) in &rows {
            let iterations = |row: &Row<'_>| row.tally.iterations().map(|(mean, _, most)| (mean, most));
            let body = bodies.iter().find(|(degree, ..)| *who == Who::Degree(*degree));
            cells.push(Cell {
                who: *who,
                step,
                cold: cold.nanoseconds(),
                warm: warm.nanoseconds(),
                cold_iterations: iterations(cold),
                warm_iterations: iterations(warm),
                failed: cold.tally.failed + warm.tally.failed,
                contradictions: body.map_or(0, |(_, a, b)| contradictions(a, b, &poses)),
            });
        }
        if let Some((cold, warm)) = run.as_ref().map(crate::comparison::CoalRun::times) {
            let none = (None, None, 0, 0);
            let (cold_iterations, warm_iterations, failed, contradictions) = none;
            cells.push(Cell {
                who: Who::Coal,
                step,
                cold,
                warm,
                cold_iterations,
                warm_iterations,
                failed,
                contradictions,
            });
        }
    }
    Ok(Steps { pair, unit_m, queries: effort.trajectories * effort.poses, cells })
}

fn query(a: &Body, b: &Body, pose: &Pose, hint: &mut WarmStart) -> Distance {
    distance(a, &Pose::identity(), b, pose, &Options::default(), hint)
}

/// Rows without and with hints.
fn ours<'a>(a: &'a Body, b: &'a Body, poses: &'a [Vec<Pose>]) -> [Row<'a>; 2] {
    let judge = |found: Distance| Answer::new(found.iterations, found.status, found.upper <= 0.0);
    [
        Row::cold("cold", poses, move |pose| judge(query(a, b, pose, &mut WarmStart::default()))),
        Row::warm("warm", poses, move |pose, hint| judge(query(a, b, pose, hint))),
    ]
}

/// Queries whose brackets with and without a hint have no number in common.
fn contradictions(a: &Body, b: &Body, poses: &[Vec<Pose>]) -> usize {
    let mut found = 0;
    for trajectory in poses {
        let mut hint = WarmStart::default();
        for pose in trajectory {
            let (cold, warm) = (query(a, b, pose, &mut WarmStart::default()), query(a, b, pose, &mut hint));
            found += usize::from(cold.lower > warm.upper || warm.lower > cold.upper);
        }
    }
    found
}
