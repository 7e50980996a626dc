//! What is counted of each stage.

use super::super::library::{Options, Stage, WarmStart, asked, except};
use super::query::{Pair, Query};
use std::collections::BTreeMap;
use std::time::Instant;

/// How many queries are kept of those that a stage rescues, and of those that are wrong without it.
const KEPT: usize = 3;

/// Of one stage: the queries that it came to its turn in, and what became of them without it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Row {
    pub(crate) asked: u64,
    /// Not converged or not decided without it.
    pub(crate) rescued: u64,
    /// Whose brackets with it and without it do not meet.
    pub(crate) wrong: u64,
    /// Sums, with the stage and without.
    pub(crate) iterations: [u64; 2],
    pub(crate) worst: [u32; 2],
    pub(crate) seconds: [f64; 2],
    /// The first that it rescued, and the first that are wrong without it.
    pub(crate) first: Vec<String>,
}

/// Of some queries.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    pub(crate) queries: u64,
    /// Not converged or not decided with all stages.
    pub(crate) unsure: u64,
    pub(crate) iterations: u64,
    pub(crate) worst: u32,
    pub(crate) seconds: f64,
    pub(crate) rows: BTreeMap<Stage, Row>,
}

impl Table {
    /// Solves with all stages, and once more without each that came to its turn; `what` names the
    /// query. The hint is that of all stages afterwards.
    pub(super) fn put(
        &mut self,
        query: Query,
        pair: Pair<'_>,
        options: &Options<'_>,
        warm: &mut WarmStart,
        what: impl Fn() -> String,
    ) {
        let hint = *warm;
        // For the first time, so that no time counted is that of reading a body from memory.
        let (_, stages) = asked(|| query.solve(pair, options, &mut hint.clone()));
        let timed = |warm: &mut WarmStart| {
            let start = Instant::now();
            let answer = query.solve(pair, options, warm);
            (answer, start.elapsed().as_secs_f64())
        };
        let (whole, seconds) = timed(warm);
        self.queries += 1;
        self.unsure += u64::from(!whole.is_sure);
        self.iterations += u64::from(whole.iterations);
        self.worst = self.worst.max(whole.iterations);
        self.seconds += seconds;
        for stage in stages {
            let (part, without) = except(&[stage], || timed(&mut hint.clone()));
            let row = self.rows.entry(stage).or_default();
            row.asked += 1;
            let (is_wrong, is_rescued) = (part.contradicts(&whole), whole.is_sure && !part.is_sure);
            row.wrong += u64::from(is_wrong);
            row.rescued += u64::from(is_rescued);
            if is_wrong || is_rescued && row.first.len() < KEPT {
                let kind = if is_wrong { "WRONG without it" } else { "rescued" };
                row.first.push(format!("{kind}: {query:?} {}: {:?}, {:?}", what(), whole.bracket, part.bracket));
            }
            for (k, (iterations, seconds)) in
                [(whole.iterations, seconds), (part.iterations, without)].into_iter().enumerate()
            {
                row.iterations[k] += u64::from(iterations);
                row.worst[k] = row.worst[k].max(iterations);
                row.seconds[k] += seconds;
            }
        }
    }

    /// What was counted of a stage, nothing where it never came to its turn.
    pub(crate) fn row(&self, stage: Stage) -> Row {
        self.rows.get(&stage).cloned().unwrap_or_default()
    }

    /// The time of all queries without a stage in parts of that with it.
    pub(crate) fn ratio(&self, stage: Stage) -> f64 {
        let [with, without] = self.row(stage).seconds;
        (self.seconds + without - with) / self.seconds
    }
}
