//! What is counted; tallies of blocks add up in any order to the same.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most failures kept word by word, of all blocks and of each.
const KEPT: usize = 500;
const KEPT_OF_A_BLOCK: usize = 10;

/// The hardest query of a kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Worst {
    pub(crate) iterations: u32,
    pub(crate) block: u64,
    pub(crate) query: u64,
}

/// Iterations of one measure, cold or warm.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Iterations {
    /// Number of solves per count of iterations.
    pub(crate) histogram: BTreeMap<u32, u64>,
    pub(crate) worst: Worst,
}

impl Iterations {
    pub(crate) fn solves(&self) -> u64 {
        self.histogram.values().sum()
    }

    pub(crate) fn mean(&self) -> f64 {
        let total: u64 = self.histogram.iter().map(|(iterations, count)| u64::from(*iterations) * count).sum();
        total as f64 / self.solves().max(1) as f64
    }

    /// Smallest count that this share of the solves does not exceed.
    pub(crate) fn quantile(&self, share: f64) -> u32 {
        let (mut seen, wanted) = (0, (share * self.solves() as f64).ceil() as u64);
        for (iterations, count) in &self.histogram {
            seen += count;
            if seen >= wanted {
                return *iterations;
            }
        }
        0
    }
}

/// One failure, to be replayed with `--block`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Failure {
    pub(crate) block: u64,
    pub(crate) query: u64,
    pub(crate) kind: String,
    pub(crate) detail: String,
}

/// Everything counted so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Tally {
    /// Bracketed solves.
    pub(crate) solves: u64,
    /// Per measure and start, such as `distance, warm`.
    pub(crate) iterations: BTreeMap<String, Iterations>,
    /// Checks made, per kind of check.
    pub(crate) checks: BTreeMap<String, u64>,
    /// Failures, per kind.
    pub(crate) failures: BTreeMap<String, u64>,
    /// The first of them.
    pub(crate) kept: Vec<Failure>,
    /// Largest deviation from the semidefinite program, relative to the size.
    pub(crate) deviation: f64,
}

impl Tally {
    pub(crate) fn solve(&mut self, name: String, worst: Worst) {
        self.solves += 1;
        let iterations = self.iterations.entry(name).or_default();
        *iterations.histogram.entry(worst.iterations).or_default() += 1;
        iterations.worst = harder(iterations.worst, worst);
    }

    /// Counts a check; where it failed, with the detail.
    pub(crate) fn check(&mut self, kind: &str, passed: bool, block: u64, query: u64, detail: impl FnOnce() -> String) {
        match self.checks.get_mut(kind) {
            Some(count) => *count += 1,
            None => _ = self.checks.insert(kind.into(), 1),
        }
        if !passed {
            *self.failures.entry(kind.into()).or_default() += 1;
            self.kept.push(Failure { block, query, kind: kind.into(), detail: detail() });
        }
    }

    pub(crate) fn add(&mut self, other: Tally) {
        self.solves += other.solves;
        for (name, theirs) in other.iterations {
            let ours = self.iterations.entry(name).or_default();
            for (count, solves) in theirs.histogram {
                *ours.histogram.entry(count).or_default() += solves;
            }
            ours.worst = harder(ours.worst, theirs.worst);
        }
        for (kind, count) in other.checks {
            *self.checks.entry(kind).or_default() += count;
        }
        for (kind, count) in other.failures {
            *self.failures.entry(kind).or_default() += count;
        }
        self.kept.extend(other.kept.into_iter().take(KEPT_OF_A_BLOCK));
        self.kept.sort();
        self.kept.truncate(KEPT);
        self.deviation = self.deviation.max(other.deviation);
    }

    pub(crate) fn failed(&self) -> u64 {
        self.failures.values().sum()
    }
}

/// The one with more iterations, of equals the first drawn.
fn harder(a: Worst, b: Worst) -> Worst {
    let earlier = |w: &Worst| std::cmp::Reverse((w.block, w.query));
    if (b.iterations, earlier(&b)) > (a.iterations, earlier(&a)) { b } else { a }
}
