//! What the server counts, for Prometheus. Names end in their unit, as is the custom there.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use prometheus_client::encoding::{EncodeLabelSet, text};
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::histogram::Histogram;
use prometheus_client::registry::{Registry, Unit};

#[cfg(feature = "fit")]
use super::job_metrics::JobMetrics;
use crate::scene::WarmStartUse;
use crate::scene::query::{Answer, AnswerStatus, StateAnswer, StateVerdict};
use crate::store::Counts;
#[cfg(feature = "fit")]
use crate::store::Job;

/// All that is counted. Clones share it.
#[derive(Clone, Debug)]
pub(super) struct Metrics(Arc<Counted>);

/// Most iterations of any measure by continuation alone, cold starts included: of level distances.
const CONTINUATION_ITERATIONS: u32 = 20;

#[derive(Debug)]
struct Counted {
    /// Held while what others count is taken over.
    taking_over: Mutex<()>,
    registry: Registry,
    calls: Family<CallEnd, Counter>,
    call_seconds: Family<Call, Histogram, fn() -> Histogram>,
    in_flight: Gauge,
    queue_seconds: Histogram,
    shed: Counter,
    connections: Gauge,
    answers: Family<Ended, Counter>,
    iterations: Counter,
    fallbacks: Counter,
    rungs: Family<Rung, Counter>,
    warm_starts: Family<Found, Counter>,
    states: Family<Verdict, Counter>,
    streamed_poses: Counter,
    overtaken_poses: Counter,
    pose_wait_seconds: Histogram,
    ready: Gauge,
    bodies: Gauge,
    unproven_bodies: Gauge,
    damaged_bodies: Gauge,
    scenes: Gauge,
    #[cfg(feature = "fit")]
    jobs: JobMetrics,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Call {
    call: String,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct CallEnd {
    call: String,
    code: String,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Ended {
    status: &'static str,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Verdict {
    verdict: &'static str,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Rung {
    rung: u32,
}

#[derive(Clone, Debug, Hash, PartialEq, Eq, EncodeLabelSet)]
struct Found {
    found: &'static str,
}

/// From 50 µs to 13 s, each twice the one before.
fn seconds() -> Histogram {
    Histogram::new((0..19).map(|power| 50e-6 * f64::from(1 << power)))
}

impl Default for Metrics {
    fn default() -> Self {
        let mut registry = Registry::with_prefix("sublevel");
        let calls = Family::default();
        registry.register("calls", "Calls that ended, by method and gRPC code", calls.clone());
        let call_seconds: Family<Call, Histogram, fn() -> Histogram> = Family::new_with_constructor(seconds);
        let about = "Time of a call from its arrival to its answer, by method; of streams to their beginning";
        registry.register_with_unit("call_duration", about, Unit::Seconds, call_seconds.clone());
        let in_flight = Gauge::default();
        registry.register("calls_in_flight", "Calls that are being answered", in_flight.clone());
        let queue_seconds = seconds();
        registry.register_with_unit(
            "queue",
            "Time that calls wait for their turn",
            Unit::Seconds,
            queue_seconds.clone(),
        );
        let shed = Counter::default();
        registry.register("shed_calls", "Calls that were refused since they had waited too long", shed.clone());
        let connections = Gauge::default();
        registry.register("connections", "Connections that are open", connections.clone());
        let answers = Family::default();
        registry.register("answers", "Measures of pairs, by how they came about", answers.clone());
        let iterations = Counter::default();
        registry.register("solver_iterations", "Iterations of the solver for all answers", iterations.clone());
        let fallbacks = Counter::default();
        let about =
            "Measures of pairs that took more iterations than continuation alone does: slower methods took over";
        registry.register("fallbacks", about, fallbacks.clone());
        let rungs = Family::default();
        let about = "Measures of pairs, by the finer of the two rungs that were used; 0 without ladders";
        registry.register("answer_rungs", about, rungs.clone());
        let warm_starts = Family::default();
        let about = "Warm starts that pairs asked for, by whether there was one from an earlier question";
        registry.register("warm_starts", about, warm_starts.clone());
        let states = Family::default();
        registry.register("states", "States of CheckStates, by verdict", states.clone());
        let streamed_poses = Counter::default();
        registry.register("streamed_poses", "Poses that came in streams", streamed_poses.clone());
        let overtaken_poses = Counter::default();
        registry.register("overtaken_poses", "Streamed poses that later ones overtook", overtaken_poses.clone());
        let pose_wait_seconds = seconds();
        let about = "Time from the arrival of a message with poses until the scene holds them";
        registry.register_with_unit("pose_wait", about, Unit::Seconds, pose_wait_seconds.clone());
        let ready = Gauge::default();
        registry.register("ready", "1 when the catalogue is loaded", ready.clone());
        let (bodies, scenes) = (Gauge::default(), Gauge::default());
        registry.register("bodies", "Bodies that are stored", bodies.clone());
        let (unproven_bodies, damaged_bodies) = (Gauge::default(), Gauge::default());
        let about = "Stored bodies that are still to be proven since the start";
        registry.register("unproven_bodies", about, unproven_bodies.clone());
        let about = "Stored bodies that are damaged and not used";
        registry.register("damaged_bodies", about, damaged_bodies.clone());
        registry.register("scenes", "Scenes and forks", scenes.clone());
        #[cfg(feature = "fit")]
        let jobs = JobMetrics::new(&mut registry);
        Self(Arc::new(Counted {
            taking_over: Mutex::default(),
            registry,
            calls,
            call_seconds,
            in_flight,
            queue_seconds,
            shed,
            connections,
            answers,
            iterations,
            fallbacks,
            rungs,
            warm_starts,
            states,
            streamed_poses,
            overtaken_poses,
            pose_wait_seconds,
            ready,
            bodies,
            unproven_bodies,
            damaged_bodies,
            scenes,
            #[cfg(feature = "fit")]
            jobs,
        }))
    }
}

/// Counts down when it is dropped.
#[derive(Debug)]
pub(super) struct Open(Gauge);

impl Drop for Open {
    fn drop(&mut self) {
        self.0.dec();
    }
}

impl Metrics {
    /// A call that begins.
    pub(super) fn begun(&self) -> Open {
        self.0.in_flight.inc();
        Open(self.0.in_flight.clone())
    }

    /// A call that ended with a gRPC code after a time.
    pub(super) fn ended(&self, call: &str, code: &str, took: Duration) {
        self.0.calls.get_or_create(&CallEnd { call: call.to_owned(), code: code.to_owned() }).inc();
        self.0.call_seconds.get_or_create(&Call { call: call.to_owned() }).observe(took.as_secs_f64());
    }

    /// A call that waited for its turn; and whether it was refused then.
    pub(super) fn queued(&self, waited: Duration, shed: bool) {
        self.0.queue_seconds.observe(waited.as_secs_f64());
        if shed {
            self.0.shed.inc();
        }
    }

    /// A connection that opens.
    pub(super) fn connected(&self) -> Open {
        self.0.connections.inc();
        Open(self.0.connections.clone())
    }

    /// Answers of a call.
    pub(super) fn answered<'a>(&self, answers: impl IntoIterator<Item = &'a Answer>) {
        let (mut by_status, mut by_rung, mut iterations, mut fallbacks) = ([0_u64; 5], [0_u64; 256], 0, 0);
        for answer in answers {
            by_status[answer.status as usize] += 1;
            by_rung[usize::from(answer.rungs[0].max(answer.rungs[1]))] += 1;
            iterations += u64::from(answer.iterations);
            fallbacks += u64::from(answer.iterations > CONTINUATION_ITERATIONS);
        }
        self.0.iterations.inc_by(iterations);
        self.0.fallbacks.inc_by(fallbacks);
        for (rung, &count) in (0..).zip(&by_rung).filter(|(_, count)| **count > 0) {
            self.0.rungs.get_or_create(&Rung { rung }).inc_by(count);
        }
        let all = [
            (AnswerStatus::Converged, "CONVERGED"),
            (AnswerStatus::BracketWide, "BRACKET_WIDE"),
            (AnswerStatus::Deadline, "DEADLINE"),
            (AnswerStatus::NotDefined, "NOT_DEFINED"),
            (AnswerStatus::Allowed, "ALLOWED"),
        ];
        for (status, name) in all {
            let count = by_status[status as usize];
            if count > 0 {
                self.0.answers.get_or_create(&Ended { status: name }).inc_by(count);
            }
        }
    }

    /// Verdicts of a call.
    pub(super) fn checked(&self, states: &[StateAnswer]) {
        let all = [
            (StateVerdict::Free, "FREE"),
            (StateVerdict::Contact, "CONTACT"),
            (StateVerdict::Undecided, "UNDECIDED"),
            (StateVerdict::Invalid, "INVALID"),
            (StateVerdict::NotChecked, "NOT_CHECKED"),
        ];
        for (verdict, name) in all {
            let count = states.iter().filter(|state| state.verdict == verdict).count() as u64;
            if count > 0 {
                self.0.states.get_or_create(&Verdict { verdict: name }).inc_by(count);
            }
        }
    }

    /// Streamed poses that were applied together, of which some were overtaken, and how long the
    /// first of them waited.
    pub(super) fn streamed(&self, poses: u64, overtaken: u64, waited: Duration) {
        self.0.streamed_poses.inc_by(poses);
        self.0.overtaken_poses.inc_by(overtaken);
        self.0.pose_wait_seconds.observe(waited.as_secs_f64());
    }

    /// A job that has ended, and how long its last attempt took, if that came to its end.
    #[cfg(feature = "fit")]
    pub(super) fn job_ended(&self, job: &Job, took: Option<Duration>) {
        self.0.jobs.ended(job, took);
    }

    /// All of it, in the text format of Prometheus; counts are those of the catalogue, if it is
    /// loaded.
    pub(super) fn text(&self, counts: Option<Counts>) -> String {
        self.0.ready.set(i64::from(counts.is_some()));
        let counts = counts.unwrap_or_default();
        #[cfg(feature = "fit")]
        self.0.jobs.set_open(counts.jobs);
        let Counts { bodies, unproven_bodies, damaged_bodies, scenes, .. } = counts;
        let sizes = [
            (&self.0.bodies, bodies),
            (&self.0.unproven_bodies, unproven_bodies),
            (&self.0.damaged_bodies, damaged_bodies),
            (&self.0.scenes, scenes),
        ];
        for (gauge, size) in sizes {
            gauge.set(i64::try_from(size).unwrap_or(i64::MAX));
        }
        let _taking_over = self.0.taking_over.lock().unwrap_or_else(PoisonError::into_inner);
        let WarmStartUse { hits, misses } = WarmStartUse::now();
        for (found, now) in [("yes", hits), ("no", misses)] {
            let counter = self.0.warm_starts.get_or_create(&Found { found });
            counter.inc_by(now.saturating_sub(counter.get()));
        }
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = text::encode(&mut text, &self.0.registry);
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_beyond_continuation_are_counted_as_fallbacks() {
        let answer = |iterations| Answer {
            status: AnswerStatus::Converged,
            lower: 0.0,
            upper: 0.0,
            value: 0.0,
            verdict: None,
            witnesses: None,
            normal: None,
            gradients: None,
            not_unique: false,
            saturated: false,
            one_sided: false,
            parts: [0; 2],
            rungs: [0; 2],
            iterations,
            multiplier: f64::NAN,
            objects_upper: f64::NAN,
        };
        let metrics = Metrics::default();
        metrics.answered(&[answer(1), answer(20), answer(21), answer(60)]);
        let text = metrics.text(None);
        for line in ["sublevel_fallbacks_total 2", "sublevel_solver_iterations_total 102"] {
            assert!(text.lines().any(|found| found == line), "{line}: {text}");
        }
    }
}
