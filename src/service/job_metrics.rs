//! What is counted of jobs.

use std::time::Duration;

use prometheus_client::encoding::EncodeLabelSet;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};

use crate::body::Solver;
use crate::store::{Job, JobCounts, JobKind, JobOutcome, JobState};

/// Counters and gauges of jobs, all there from the start. Clones share them.
#[derive(Clone, Debug)]
pub(super) struct JobMetrics {
    open: Family<Open, Gauge>,
    ended: Family<Ended, Counter>,
    seconds: Family<Task, Histogram, fn() -> Histogram>,
    programs: Family<Program, Counter>,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Task {
    task: &'static str,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Open {
    task: &'static str,
    state: &'static str,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Ended {
    task: &'static str,
    outcome: &'static str,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Program {
    solver: &'static str,
    fallback: &'static str,
}

/// From 10 ms to 22 min, each twice the one before.
fn seconds() -> Histogram {
    Histogram::new((0..18).map(|power| 10e-3 * f64::from(1 << power)))
}

impl JobMetrics {
    pub(super) fn new(registry: &mut Registry) -> Self {
        let open = Family::default();
        registry.register("jobs", "Jobs that have not ended, by task and state", open.clone());
        let ended = Family::default();
        registry.register("ended_jobs", "Jobs that ended, by task and outcome", ended.clone());
        let seconds: Family<Task, Histogram, fn() -> Histogram> = Family::new_with_constructor(seconds);
        let about = "Time of the attempts at which jobs succeeded or failed, by task";
        registry.register_with_unit("job_duration", about, Unit::Seconds, seconds.clone());
        let programs = Family::default();
        let about = "Programs of the bodies that fits made, by what solved them and whether another solver had failed";
        registry.register("fit_programs", about, programs.clone());
        let metrics = Self { open, ended, seconds, programs };
        for task in JobKind::ALL.map(JobKind::name) {
            for outcome in ["succeeded", "failed", "cancelled"] {
                drop(metrics.ended.get_or_create(&Ended { task, outcome }));
            }
            drop(metrics.seconds.get_or_create(&Task { task }));
        }
        for solver in Solver::ALL {
            for fallback in ["no", "yes"] {
                drop(metrics.programs.get_or_create(&Program { solver: solver.name(), fallback }));
            }
        }
        metrics
    }

    /// Takes over how many jobs wait and run.
    pub(super) fn set_open(&self, counts: [JobCounts; JobKind::ALL.len()]) {
        for (kind, JobCounts { queued, running }) in JobKind::ALL.iter().zip(counts) {
            for (state, count) in [("queued", queued), ("running", running)] {
                let gauge = self.open.get_or_create(&Open { task: kind.name(), state });
                gauge.set(i64::try_from(count).unwrap_or(i64::MAX));
            }
        }
    }

    /// A job that has ended, and how long its last attempt took, if that came to its end.
    pub(super) fn ended(&self, job: &Job, took: Option<Duration>) {
        let task = job.task.kind().name();
        let outcome = match &job.state {
            JobState::Succeeded(_) => "succeeded",
            JobState::Cancelled => "cancelled",
            JobState::Failed(_) | JobState::Queued | JobState::Running => "failed",
        };
        self.ended.get_or_create(&Ended { task, outcome }).inc();
        if let Some(took) = took {
            self.seconds.get_or_create(&Task { task }).observe(took.as_secs_f64());
        }
        let JobState::Succeeded(JobOutcome::Fit(fit)) = &job.state else { return };
        for optimum in fit.bodies.iter().filter_map(|body| body.optimum.as_ref()) {
            let Some(solver) = optimum.solver else { continue };
            let fallback = if optimum.fallback.is_some() { "yes" } else { "no" };
            self.programs.get_or_create(&Program { solver: solver.name(), fallback }).inc();
        }
    }
}
