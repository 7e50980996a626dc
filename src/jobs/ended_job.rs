//! Reports of jobs that have ended, for metrics.

use std::fmt;
use std::sync::Arc;
use std::time::Duration;

use crate::store::Job;

/// Called once for each job that has ended, with the time of its last attempt, if there was one and
/// it came to its end.
#[derive(Clone)]
pub(super) struct Listener(Arc<Hear>);

type Hear = dyn Fn(&Job, Option<Duration>) + Send + Sync;

impl Listener {
    pub(super) fn new(listener: impl Fn(&Job, Option<Duration>) + Send + Sync + 'static) -> Self {
        Self(Arc::new(listener))
    }

    pub(super) fn hear(&self, job: &Job, took: Option<Duration>) {
        self.0(job, took);
    }
}

impl Default for Listener {
    fn default() -> Self {
        Self::new(|_, _| {})
    }
}

impl fmt::Debug for Listener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Listener")
    }
}
