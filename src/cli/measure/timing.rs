//! Time per query: cold, warm and in batches.

use super::query::Query;
use crate::measure::{Distance, Pose, WarmStart, distance_batch};
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Passes over all poses, of which the median counts.
const PASSES: usize = 9;

/// Most poses of a batch.
const BATCH: usize = 1024;

#[derive(Serialize)]
pub(super) struct Times {
    distance: Time,
    level: Time,
}

#[derive(Serialize)]
struct Time {
    queries: usize,
    cold_ns: f64,
    warm_ns: f64,
    /// Per pose, cold; of measures that have a batch form.
    #[serde(skip_serializing_if = "Option::is_none")]
    batch_ns: Option<f64>,
}

/// Times distance and d(A‖B) over all poses.
pub(super) fn time(query: &Query, trajectories: &[Vec<Pose>]) -> Times {
    let distance = one(trajectories, |pose, warm| {
        black_box(query.distance(pose, warm));
    });
    Times {
        distance: Time { batch_ns: Some(batch(query, trajectories)), ..distance },
        level: one(trajectories, |pose, warm| {
            black_box(query.level_ab(pose, warm));
        }),
    }
}

/// Nanoseconds per pose of batches of consecutive poses.
fn batch(query: &Query, trajectories: &[Vec<Pose>]) -> f64 {
    let poses = trajectories.concat();
    let mut answers = vec![Distance::default(); poses.len().min(BATCH)];
    let pass = || {
        let start = Instant::now();
        for poses in poses.chunks(BATCH) {
            let answers = &mut answers[..poses.len()];
            distance_batch(&*query.a, &Pose::identity(), &*query.b, black_box(poses), &query.options, answers)
                .expect("a chunk has poses, and a place for each answer");
            black_box(answers);
        }
        start.elapsed().as_nanos() as f64 / poses.len() as f64
    };
    median(pass)
}

fn one(trajectories: &[Vec<Pose>], query: impl Fn(&Pose, &mut WarmStart)) -> Time {
    let queries = trajectories.iter().map(Vec::len).sum();
    let pass = |cold: bool| {
        let start = Instant::now();
        for trajectory in trajectories {
            let mut warm = WarmStart::default();
            for pose in trajectory {
                if cold {
                    warm = WarmStart::default();
                }
                query(black_box(pose), &mut warm);
            }
        }
        start.elapsed().as_nanos() as f64 / queries as f64
    };
    Time { queries, cold_ns: median(|| pass(true)), warm_ns: median(|| pass(false)), batch_ns: None }
}

/// The middle one of several passes.
fn median(mut pass: impl FnMut() -> f64) -> f64 {
    let mut passes: Vec<f64> = (0..PASSES).map(|_| pass()).collect();
    passes.sort_by(f64::total_cmp);
    passes[PASSES / 2]
}
