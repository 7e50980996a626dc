//! The paper's experiment: the chair moves past the human, through the place where it stands.

use crate::comparison::sweep::median;
use nalgebra::Vector3;
use std::hint::black_box;
use std::time::Instant;
use sublevel::body::{Body, Solid};
use sublevel::measure::{LevelDistance, Options, Pose, PoseError, WarmStart, level_distance};

/// How often a query is repeated to be timed: a clock cannot see a single one.
const REPEATS: u32 = 64;
/// How far the chair goes beyond where the balls around both touch.
const BEYOND: f64 = 0.2;

/// One position of the chair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop {
    /// Of the chair's centre along x, from the human's, metres.
    pub(super) position_m: f64,
    /// d(chair‖human) and d(human‖chair).
    pub(super) levels: [f64; 2],
    /// Widest bracket of the two, relative to max(1, d).
    pub(super) width: f64,
    /// Nanoseconds per query of d(chair‖human), without a hint and with that of the position
    /// before.
    pub(super) cold: f64,
    pub(super) warm: f64,
    /// Iterations.
    pub(super) cold_iterations: u32,
    pub(super) warm_iterations: u32,
    /// Whether brackets with and without a hint have no number in common, or one is wide.
    pub(super) wrong: bool,
}

/// The chair's way.
pub(super) struct Passage {
    pub(super) stops: Vec<Stop>,
}

/// Moves the chair along x in steps of one length, its centre at the height and depth of the
/// human's.
pub(super) fn passage((chair, human): (&Body, &Body), positions: usize, passes: usize) -> Result<Passage, PoseError> {
    let options = Options::default();
    let level = |a: &Body, of_a: &Pose, b: &Body, of_b: &Pose, hint: &mut WarmStart| {
        level_distance(a, of_a, b, of_b, &options, hint)
    };
    let reach = (1.0 + BEYOND) * (chair.circumscribed().radius + human.circumscribed().radius);
    let middle = |body: &Body| Solid::circumscribed(body).center;
    let at = |x: f64| Pose::from_quaternion(middle(human) - middle(chair) + Vector3::x() * x, [0.0, 0.0, 0.0, 1.0]);
    let origin = Pose::identity();
    let mut hints = [WarmStart::default(); 2];
    let mut stops = Vec::new();
    for k in 0..positions {
        let position_m = reach * (2.0 * k as f64 / (positions - 1) as f64 - 1.0);
        let pose = at(position_m)?;
        let before = hints[0];
        let warm = level(chair, &pose, human, &origin, &mut hints[0]);
        let other = level(human, &origin, chair, &pose, &mut hints[1]);
        let cold = level(chair, &pose, human, &origin, &mut WarmStart::default());
        let time = |hint: WarmStart| {
            let runs = (0..passes).map(|_| {
                let start = Instant::now();
                for _ in 0..REPEATS {
                    let mut hint = black_box(hint);
                    black_box(level(chair, black_box(&pose), human, &origin, &mut hint));
                }
                start.elapsed().as_nanos() as f64 / f64::from(REPEATS)
            });
            median(&runs.collect::<Vec<_>>())
        };
        let width = |d: &LevelDistance| (d.upper - d.lower) / d.upper.max(1.0);
        let all = [&warm, &other, &cold];
        stops.push(Stop {
            position_m,
            levels: [warm.value(), other.value()],
            width: all.iter().map(|d| width(d)).fold(0.0, f64::max),
            cold: time(WarmStart::default()),
            warm: time(before),
            cold_iterations: cold.iterations,
            warm_iterations: warm.iterations,
            wrong: warm.lower > cold.upper
                || cold.lower > warm.upper
                || all.iter().any(|d| width(d) > options.accuracy()),
        });
    }
    Ok(Passage { stops })
}
