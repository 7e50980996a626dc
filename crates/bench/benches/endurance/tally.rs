//! What is counted; tallies of blocks add up in any order to the same.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most failures of a check kept word by word, of all blocks and of each.
const KEPT: usize = 200;
const KEPT_OF_A_BLOCK: usize = 10;

/// Iterations that none should exceed.
pub(crate) const WANTED: u32 = 30;

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
    pub(crate) fn count(&mut self, solve: Worst) {
        *self.histogram.entry(solve.iterations).or_default() += 1;
        self.worst = harder(self.worst, solve);
    }

    pub(crate) fn solves(&self) -> u64 {
        self.histogram.values().sum()
    }

    pub(crate) fn mean(&self) -> f64 {
        let total: u64 = self.histogram.iter().map(|(iterations, count)| u64::from(*iterations) * count).sum();
        total as f64 / self.solves().max(1) as f64
    }

    /// Share of the solves that took more iterations than that.
    pub(crate) fn above(&self, iterations: u32) -> f64 {
        let more = self.histogram.iter().filter(|(spent, _)| **spent > iterations).map(|(_, count)| count);
        more.sum::<u64>() as f64 / self.solves().max(1) as f64
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

/// What is compared with an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) enum Check {
    InOrder,
    Converged,
    Honest,
    Capped,
    Meet,
    Feasible,
    Decision,
    Truth,
    Decided,
    Solved,
    Agrees,
}

impl Check {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Check::InOrder => "bracket in order",
            Check::Converged => "converged",
            Check::Honest => "status honest",
            Check::Capped => "iterations capped",
            Check::Meet => "brackets of the same poses from another start meet",
            Check::Feasible => "witnesses feasible",
            Check::Decision => "decisions agree with the bracket",
            Check::Truth => "truth with 200 bits in the bracket",
            Check::Decided => "reference decides",
            Check::Solved => "semidefinite program solved",
            Check::Agrees => "semidefinite program agrees to 1e-6",
        }
    }
}

/// One failure, to be replayed with `--block`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub(crate) struct Failure {
    pub(crate) block: u64,
    pub(crate) query: u64,
    pub(crate) check: Check,
    pub(crate) detail: String,
}

/// Everything counted so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Tally {
    /// Bracketed solves.
    pub(crate) solves: u64,
    /// Per measure, kind of bodies and start, such as `distance, smooth, warm`.
    pub(crate) iterations: BTreeMap<String, Iterations>,
    /// Checks made.
    pub(crate) checks: BTreeMap<Check, u64>,
    /// Failures.
    pub(crate) failures: BTreeMap<Check, u64>,
    /// The first failures of each check.
    pub(crate) kept: Vec<Failure>,
    /// Of a block that is replayed, the solves that took most iterations, with their number.
    #[serde(skip)]
    pub(crate) slow: Vec<(u32, u64, String)>,
    /// Largest deviation from the semidefinite program, relative to the size.
    pub(crate) deviation: f64,
}

impl Tally {
    /// Takes the iterations of solves that are counted already.
    pub(crate) fn iterations(&mut self, name: String, theirs: Iterations) {
        if theirs.histogram.is_empty() {
            return;
        }
        let ours = self.iterations.entry(name).or_default();
        for (count, solves) in theirs.histogram {
            *ours.histogram.entry(count).or_default() += solves;
        }
        ours.worst = harder(ours.worst, theirs.worst);
    }

    /// Counts a check; where it failed, with the detail.
    pub(crate) fn check(
        &mut self,
        check: Check,
        passed: bool,
        (block, query): (u64, u64),
        detail: impl FnOnce() -> String,
    ) {
        *self.checks.entry(check).or_default() += 1;
        if !passed {
            *self.failures.entry(check).or_default() += 1;
            if self.kept.iter().filter(|kept| kept.check == check).count() < KEPT_OF_A_BLOCK {
                self.kept.push(Failure { block, query, check, detail: detail() });
            }
        }
    }

    /// Takes down a solve if it is one of the slow ones.
    pub(crate) fn slow(&mut self, solve: Worst, detail: impl FnOnce() -> String) {
        if solve.iterations > WANTED {
            self.slow.push((solve.iterations, solve.query, detail()));
        }
    }

    pub(crate) fn add(&mut self, other: Tally) {
        self.solves += other.solves;
        for (name, theirs) in other.iterations {
            self.iterations(name, theirs);
        }
        for (kind, count) in other.checks {
            *self.checks.entry(kind).or_default() += count;
        }
        for (kind, count) in other.failures {
            *self.failures.entry(kind).or_default() += count;
        }
        self.kept.extend(other.kept);
        self.kept.sort();
        let mut counts = BTreeMap::new();
        self.kept.retain(|failure| {
            let count = counts.entry(failure.check).or_insert(0);
            *count += 1;
            *count <= KEPT
        });
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
