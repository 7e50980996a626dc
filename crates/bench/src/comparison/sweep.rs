//! A row: one query over all poses, timed pass by pass.

use std::cell::RefCell;
use std::hint::black_box;
use std::time::Instant;
use sublevel::measure::Status;

/// What a row needs to know of an answer.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// None where the solver does not tell.
    pub iterations: Option<u32>,
    /// Whether there is no answer, or not of the accuracy asked for.
    pub failed: bool,
    /// Whether the bodies were found to overlap or touch.
    pub overlap: bool,
}

impl Answer {
    /// Of one of our measures.
    pub fn new(iterations: u32, status: Status, overlap: bool) -> Self {
        Self { iterations: Some(iterations), failed: status != Status::Converged, overlap }
    }
}

/// What came of all queries of a row.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Queries.
    pub queries: usize,
    /// Of them, those that failed.
    pub failed: usize,
    /// Of them, those with overlap or touch.
    pub overlaps: usize,
    /// Of each query that says.
    iterations: Vec<u32>,
}

impl Tally {
    fn add(&mut self, answer: &Answer) {
        self.queries += 1;
        self.failed += usize::from(answer.failed);
        self.overlaps += usize::from(answer.overlap);
        self.iterations.extend(answer.iterations);
    }

    /// Mean, median and worst number of iterations, if they are reported.
    pub fn iterations(&self) -> Option<(f64, f64, u32)> {
        let counts: Vec<f64> = self.iterations.iter().copied().map(f64::from).collect();
        let most = self.iterations.iter().max().filter(|most| **most > 0)?;
        Some((counts.iter().sum::<f64>() / counts.len() as f64, median(&counts), *most))
    }
}

/// Walks of a trajectory in a [`Row::turn`]: those of coal's program.
const WALKS: usize = 9;
/// Queries that take longer than this are walked once, nanoseconds.
const SLOW_NS: f64 = 5000.0;

fn median_of(count: usize, time: impl Fn() -> f64) -> f64 {
    median(&(0..count).map(|_| time()).collect::<Vec<_>>())
}

/// A query over all poses with its times so far.
pub struct Row<'a> {
    /// Name in tables.
    pub label: String,
    /// What came of its queries.
    pub tally: Tally,
    /// Nanoseconds of each trajectory in each pass so far.
    passes: Vec<Vec<f64>>,
    time: Box<dyn Fn(usize) -> Vec<f64> + 'a>,
}

impl<'a> Row<'a> {
    /// A row of `query`, which keeps between the poses of a trajectory the content of `T`.
    pub fn warm<P, T: Default>(
        label: impl Into<String>,
        trajectories: &'a [Vec<P>],
        query: impl Fn(&P, &mut T) -> Answer + 'a,
    ) -> Self {
        let mut tally = Tally::default();
        // Counted before and not while timing.
        for trajectory in trajectories {
            walk(trajectory, &query, |answer| tally.add(&answer));
        }
        let time = Box::new(move |walks| {
            let timed = |trajectory: &Vec<P>| {
                let start = Instant::now();
                walk(trajectory, &query, |answer| {
                    black_box(answer);
                });
                start.elapsed().as_nanos() as f64
            };
            trajectories.iter().map(|trajectory| median_of(walks, || timed(trajectory))).collect()
        });
        Self { label: label.into(), tally, passes: Vec::new(), time }
    }

    /// A row of `query`, which knows nothing of the pose before.
    pub fn cold<P>(label: impl Into<String>, trajectories: &'a [Vec<P>], query: impl Fn(&P) -> Answer + 'a) -> Self {
        Self::warm(label, trajectories, move |pose, (): &mut ()| query(pose))
    }

    /// A row of batches of up to `most` consecutive poses; `batch` writes its answers where it is
    /// asked to.
    pub fn batches<P, T: Clone + Default + 'a>(
        label: impl Into<String>,
        trajectories: &'a [Vec<P>],
        most: usize,
        batch: impl Fn(&[P], &mut [T]) + 'a,
        judge: impl Fn(&T) -> Answer,
    ) -> Self {
        let longest = trajectories.iter().map(Vec::len).max().unwrap_or(0);
        let places = RefCell::new(vec![T::default(); longest.min(most)]);
        let mut tally = Tally::default();
        for poses in trajectories.iter().flat_map(|trajectory| trajectory.chunks(most)) {
            let answers = &mut places.borrow_mut()[..poses.len()];
            batch(poses, answers);
            answers.iter().for_each(|answer| tally.add(&judge(answer)));
        }
        let time = Box::new(move |walks| {
            let timed = |trajectory: &Vec<P>| {
                let mut places = places.borrow_mut();
                let start = Instant::now();
                for poses in trajectory.chunks(most) {
                    let answers = &mut places[..poses.len()];
                    batch(black_box(poses), answers);
                    black_box(answers);
                }
                start.elapsed().as_nanos() as f64
            };
            trajectories.iter().map(|trajectory| median_of(walks, || timed(trajectory))).collect()
        });
        Self { label: label.into(), tally, passes: Vec::new(), time }
    }

    /// Times one pass over all poses.
    pub fn pass(&mut self) {
        self.passes.push((self.time)(1));
    }

    /// Times one pass in which each trajectory is walked nine times on end and the median walk
    /// counts: as coal's program does it, whose caches and branches are warm by then. Slow queries
    /// are walked once.
    pub fn turn(&mut self) {
        // What takes long forgets the walk before by its end anyway.
        let walks = if self.nanoseconds() > SLOW_NS { 1 } else { WALKS };
        self.passes.push((self.time)(walks));
    }

    /// Nanoseconds per query: the median pass of each trajectory, summed.
    ///
    /// Whole passes are long enough that other processes interrupt every one on a busy machine;
    /// trajectories are not.
    pub fn nanoseconds(&self) -> f64 {
        let trajectories = self.passes.first().map_or(0, Vec::len);
        let of = |trajectory: usize| median(&self.passes.iter().map(|pass| pass[trajectory]).collect::<Vec<_>>());
        (0..trajectories).map(of).sum::<f64>() / self.tally.queries as f64
    }
}

/// All poses of a trajectory, one after the other.
#[inline(always)]
fn walk<P, T: Default>(trajectory: &[P], query: &impl Fn(&P, &mut T) -> Answer, mut record: impl FnMut(Answer)) {
    let mut kept = T::default();
    for pose in trajectory {
        record(query(black_box(pose), &mut kept));
    }
}

/// The middle value; NaN of none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}
