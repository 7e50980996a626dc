//! Time per query, cold and warm.

use super::Query;
use crate::measure::{Pose, WarmStart};
use serde::Serialize;
use std::hint::black_box;
use std::time::Instant;

/// Passes over all poses, of which the median counts.
const PASSES: usize = 9;

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
}

/// Times distance and d(A‖B) over all poses.
pub(super) fn time(query: &Query, trajectories: &[Vec<Pose>]) -> Times {
    Times {
        distance: one(trajectories, |pose, warm| {
            black_box(query.distance(pose, warm));
        }),
        level: one(trajectories, |pose, warm| {
            black_box(query.level_ab(pose, warm));
        }),
    }
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
    let median = |cold: bool| {
        let mut passes: Vec<f64> = (0..PASSES).map(|_| pass(cold)).collect();
        passes.sort_by(f64::total_cmp);
        passes[PASSES / 2]
    };
    Time { queries, cold_ns: median(true), warm_ns: median(false) }
}
