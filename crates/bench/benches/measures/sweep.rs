//! A row: one query over all poses, timed pass by pass, and what its time is compared with.

use sublevel_bench::comparison::sweep;
pub(crate) use sublevel_bench::comparison::sweep::Answer;

/// A bound that a row is to stay below.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Target {
    /// Part of the time of the row with this label.
    PartOf(&'static str, f64),
    /// Nanoseconds on machines of the class named in the figures.
    Nanoseconds(f64),
    /// So many times the time of the row with the same label on separated motions.
    OfSeparated(f64),
    /// Iterations on average.
    MeanIterations(f64),
    /// Iterations, or queries of other measures, of the median query.
    MedianIterations(u32),
    /// Iterations in the worst case.
    MostIterations(u32),
}

/// One line of a table.
pub(crate) struct Row<'a> {
    pub(crate) timed: sweep::Row<'a>,
    pub(crate) targets: Vec<Target>,
}

impl<'a> From<sweep::Row<'a>> for Row<'a> {
    fn from(timed: sweep::Row<'a>) -> Self {
        Self { timed, targets: Vec::new() }
    }
}

impl<'a> Row<'a> {
    /// A row of `query`, which keeps between the poses of a trajectory the content of `T`.
    pub(crate) fn warm<P, T: Default>(
        label: impl Into<String>,
        trajectories: &'a [Vec<P>],
        query: impl Fn(&P, &mut T) -> Answer + 'a,
    ) -> Self {
        sweep::Row::warm(label, trajectories, query).into()
    }

    /// A row of `query`, which knows nothing of the pose before.
    pub(crate) fn cold<P>(
        label: impl Into<String>,
        trajectories: &'a [Vec<P>],
        query: impl Fn(&P) -> Answer + 'a,
    ) -> Self {
        sweep::Row::cold(label, trajectories, query).into()
    }

    /// A row of batches of up to `most` consecutive poses; `batch` writes its answers where it is
    /// asked to.
    pub(crate) fn batches<P, T: Clone + Default + 'a>(
        label: impl Into<String>,
        trajectories: &'a [Vec<P>],
        most: usize,
        batch: impl Fn(&[P], &mut [T]) + 'a,
        judge: impl Fn(&T) -> Answer,
    ) -> Self {
        sweep::Row::batches(label, trajectories, most, batch, judge).into()
    }

    /// The same row with a target.
    pub(crate) fn at_most(mut self, target: Target) -> Self {
        self.targets.push(target);
        self
    }
}
