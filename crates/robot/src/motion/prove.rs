//! The search: pairs are decided on intervals, and intervals halved where pairs are open.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Options, WarmStart};

use super::answer::{MotionAnswer, MotionContact, MotionVerdict};
use super::certificate::{Certificate, Proof, Record};
use super::geometry::Piece;
use super::interval::Interval;
use super::path::Path;
use super::placing::{PlacedPiece, Placing};
use super::planes::{Height, Tangent, gap};
use super::problem::{MotionProblem, PiecePair};
use super::solve::{Solved, solve};

/// Default of [`MotionOptions::resolution_m`].
pub const DEFAULT_RESOLUTION_M: f64 = 1e-4;

/// Default of [`MotionOptions::max_configurations`].
pub const DEFAULT_MAX_CONFIGURATIONS: u32 = 100_000;

/// A pair that planes keep apart is solved where it may get nearer by at most so many times the gap
/// that the planes show; otherwise the interval is halved at once.
///
/// A smaller value halves intervals that a solve would have decided, a larger one solves pairs that
/// are halved all the same.
const HOPELESS: f64 = 4.0;

/// Most open pairs of all intervals that wait, each interval counted as [`INTERVAL_PAIRS`] more;
/// more end the search early.
const MAX_WAITING_PAIRS: usize = 1 << 24;

/// Open pairs that take as much memory as an interval that waits.
const INTERVAL_PAIRS: usize = 20;

/// Most records of a certificate, tens of megabytes; more end the search early.
const MAX_RECORDS: usize = 1 << 18;

/// Lists that are kept for the next search.
const MAX_SPARE: usize = 64;

/// How the search goes on and when it ends.
#[derive(Clone, Copy, Debug)]
pub struct MotionOptions<'a> {
    /// Where no point can move by more than this, metres, a pair that is still open stays so.
    pub resolution_m: f64,
    /// Most configurations to look at.
    pub max_configurations: u32,
    /// Whether the first contact is looked for until the resolution; otherwise the search ends at
    /// any contact.
    pub first_contact: bool,
    /// How far the proven clearance may be below the true one, metres, of a motion that is free;
    /// none: it is only proven to be at least the margin.
    pub clearance_accuracy_m: Option<f64>,
    /// Whether to write down what proves a free motion.
    pub certificate: bool,
    /// Ends the search when it is set.
    pub stop: Option<&'a AtomicBool>,
}

impl Default for MotionOptions<'_> {
    fn default() -> Self {
        Self {
            resolution_m: DEFAULT_RESOLUTION_M,
            max_configurations: DEFAULT_MAX_CONFIGURATIONS,
            first_contact: false,
            clearance_accuracy_m: None,
            certificate: false,
            stop: None,
        }
    }
}

/// Memory that serves one search after another: buffers, and starts for the solver, which change
/// how long a search takes and nothing it proves.
#[derive(Debug, Default)]
pub struct MotionWorkspace {
    placing: Placing,
    /// Per pair.
    starts: Vec<WarmStart>,
    /// Per pair, the last normal; zero: none yet.
    normals: Vec<Vector3<f64>>,
    queue: VecDeque<(Interval, Open)>,
    /// All pairs.
    all: Vec<u32>,
    spare: Vec<Vec<u32>>,
}

/// Which pairs are open on an interval; none: all.
type Open = Option<Vec<u32>>;

/// What a pair is on an interval.
enum PairState {
    /// Farther apart than its threshold on all of it; signed distance at least this, metres.
    Free(f64),
    /// In contact in the middle, and whether the interval is so short that this ends it.
    Contact(MotionContact, bool),
    /// Neither is known; with what is, where the interval is so short that it stays so.
    Open(Option<MotionContact>),
}

impl MotionProblem {
    /// Decides whether a path is free.
    ///
    /// # Panics
    /// When the path is one of another robot.
    pub fn prove(&self, path: &Path, options: &MotionOptions<'_>, workspace: &mut MotionWorkspace) -> MotionAnswer {
        workspace.starts.resize(self.pairs.len(), WarmStart::default());
        workspace.normals.resize(self.pairs.len(), Vector3::zeros());
        let mut search = Search {
            problem: self,
            path,
            options,
            workspace,
            contact: None,
            open: None,
            alpha: 1.0,
            is_unproven: false,
            clearance: f64::INFINITY,
            nearest: f64::INFINITY,
            configurations: 0,
            solved: 0,
            waiting: 0,
            records: Vec::new(),
        };
        search.run()
    }
}

/// A search under way.
struct Search<'a, 'b> {
    problem: &'a MotionProblem,
    path: &'a Path,
    options: &'a MotionOptions<'b>,
    workspace: &'a mut MotionWorkspace,
    /// The first contact that was seen.
    contact: Option<MotionContact>,
    /// The first pair that stays open.
    open: Option<MotionContact>,
    /// No interval that is not free begins before this.
    alpha: f64,
    /// Whether some interval is not free.
    is_unproven: bool,
    /// Least lower bound of signed distance less padding over all that is proven.
    clearance: f64,
    /// Least upper bound of the same at configurations that were looked at.
    nearest: f64,
    configurations: u32,
    solved: u32,
    /// Open pairs of all intervals in the queue, and what these take themselves.
    waiting: usize,
    records: Vec<Record>,
}

impl Search<'_, '_> {
    fn run(&mut self) -> MotionAnswer {
        let count = u32::try_from(self.problem.pairs.len()).unwrap_or(u32::MAX);
        let mut all = std::mem::take(&mut self.workspace.all);
        all.clear();
        all.extend(0..count);
        self.workspace.queue.clear();
        let segments = u32::try_from(self.path.segments()).unwrap_or(u32::MAX);
        self.workspace.queue.extend((0..segments).map(|segment| (Interval::whole(segment), None)));
        let mut ended_early = false;
        // Wide intervals first: a contact is seen early, and what lies beyond it need not be
        // proven.
        while let Some((interval, pairs)) = self.workspace.queue.pop_front() {
            self.waiting -= pairs.as_ref().map_or(0, |open| open.len() + INTERVAL_PAIRS);
            if self.is_beyond_contact(&interval) {
                self.workspace.spare.extend(pairs);
                continue;
            }
            let is_full = self.waiting > MAX_WAITING_PAIRS || self.records.len() > MAX_RECORDS;
            if self.configurations >= self.options.max_configurations || is_full || self.is_stopped() {
                self.workspace.queue.push_front((interval, pairs));
                ended_early = true;
                break;
            }
            self.configurations += 1;
            self.decide(&interval, pairs.as_deref().unwrap_or(&all));
            self.workspace.spare.extend(pairs);
            if self.contact.is_some() && !self.options.first_contact {
                break;
            }
        }
        self.workspace.all = all;
        let answer = self.answer(ended_early);
        self.workspace.queue.clear();
        self.workspace.spare.truncate(MAX_SPARE);
        answer
    }

    /// Where no pair is looked at again, metres.
    fn resolution_m(&self) -> f64 {
        let MotionOptions { resolution_m, clearance_accuracy_m, .. } = *self.options;
        clearance_accuracy_m.map_or(resolution_m, |accuracy| resolution_m.min(0.25 * accuracy))
    }

    fn is_stopped(&self) -> bool {
        self.options.stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// Path parameter of a place of a segment.
    fn parameter(&self, interval: &Interval, t: f64) -> f64 {
        (f64::from(interval.segment) + t) / self.path.segments() as f64
    }

    /// Whether an interval begins beyond the first contact; its start is rounded.
    fn is_beyond_contact(&self, interval: &Interval) -> bool {
        let start = self.parameter(interval, interval.start()) * (1.0 - 4.0 * f64::EPSILON);
        self.contact.as_ref().is_some_and(|contact| start >= contact.s)
    }

    /// An interval is not free.
    fn leave(&mut self, interval: &Interval) {
        let start = self.parameter(interval, interval.start()) * (1.0 - 4.0 * f64::EPSILON);
        self.alpha = self.alpha.min(start);
        self.is_unproven = true;
    }

    /// Decides the open pairs of an interval; what stays open is put into the queue.
    fn decide(&mut self, interval: &Interval, pairs: &[u32]) {
        self.workspace.placing.set(self.problem, self.path, interval);
        let mut open = self.workspace.spare.pop().unwrap_or_default();
        open.clear();
        let mut stuck = None;
        for &index in pairs {
            match self.pair(interval, index) {
                PairState::Free(clearance) => self.clearance = self.clearance.min(clearance),
                PairState::Contact(contact, ends) => {
                    if ends {
                        self.leave(interval);
                    } else {
                        open.push(index);
                    }
                    if self.contact.as_ref().is_none_or(|before| contact.s < before.s) {
                        self.contact = Some(contact);
                    }
                    if !self.options.first_contact {
                        self.leave(interval);
                        break;
                    }
                }
                PairState::Open(None) => open.push(index),
                PairState::Open(Some(at)) => {
                    self.leave(interval);
                    stuck.get_or_insert(at);
                }
            }
        }
        if let Some(at) = stuck
            && self.open.as_ref().is_none_or(|before| at.s < before.s)
        {
            self.open = Some(at);
        }
        match interval.halves().filter(|_| !open.is_empty()) {
            Some([left, right]) => {
                let mut same = self.workspace.spare.pop().unwrap_or_default();
                same.clone_from(&open);
                self.waiting += 2 * (open.len() + INTERVAL_PAIRS);
                self.workspace.queue.push_back((left, Some(open)));
                self.workspace.queue.push_back((right, Some(same)));
            }
            None => {
                if !open.is_empty() {
                    self.leave(interval);
                }
                self.workspace.spare.push(open);
            }
        }
    }

    fn pair(&mut self, interval: &Interval, index: u32) -> PairState {
        let problem = self.problem;
        let pair = &problem.pairs[index as usize];
        let Some(placed) = self.workspace.placing.pair(problem, pair) else { return PairState::Open(None) };
        let approach = self.workspace.placing.approach_m(pair, &placed);
        let error = placed[0].error_m() + placed[1].error_m();
        let between = placed[0].ball.center - placed[1].ball.center;
        let line = between.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let pair = PairAt { pair, index, placed, approach, error, interval: *interval };
        // Balls, along the line of their centres.
        let balls = between.norm() * (1.0 - 1e-15) - placed[0].ball.radius - placed[1].ball.radius;
        if let Some(clearance) = self.settled(&pair, balls - approach)
            && self.record(&pair, &line, || Proof::Balls)
        {
            return PairState::Free(clearance);
        }
        // Planes across the last normal, then across that line.
        let hint = self.workspace.normals[index as usize];
        let hint = (hint != Vector3::zeros()).then_some(hint);
        let mut gap = f64::NEG_INFINITY;
        for n in hint.into_iter().chain([self.first_normal(&pair, &line)]) {
            let found = self.planes(&pair, &n, [Height::Table, Height::Table]);
            if let Some(clearance) = self.settled_along(&pair, found, &n)
                && self.record(&pair, &n, || Proof::Planes)
            {
                self.workspace.normals[index as usize] = n;
                return PairState::Free(clearance);
            }
            gap = gap.max(found);
        }
        let spare = gap - error - pair.pair.threshold_m;
        let refines = self.options.clearance_accuracy_m.is_some();
        if !refines && spare > 0.0 && approach > HOPELESS * spare && approach > self.resolution_m() {
            return PairState::Open(None);
        }
        self.solved(&pair)
    }

    /// Where a normal is looked for that no earlier answer has left.
    fn first_normal(&self, pair: &PairAt<'_>, line: &Vector3<f64>) -> Vector3<f64> {
        match self.problem.piece(pair.pair.pieces[1]).1 {
            Piece::HalfSpace(half_space, _) => *half_space.normal(),
            _ => *line,
        }
    }

    /// Solves the distance of a pair in the middle of the interval.
    fn solved(&mut self, pair: &PairAt<'_>) -> PairState {
        let problem = self.problem;
        let [a, b] = pair.pair.pieces.map(|piece| problem.piece(piece).1);
        let [at_a, at_b] = [0, 1].map(|side| pair.placed[side].pose);
        let threshold = pair.pair.threshold_m;
        let options = self.options.stop.map_or(Options::default(), |stop| Options::default().with_stop(stop));
        let start = &mut self.workspace.starts[pair.index as usize];
        let mut found = solve((&a, &at_a), (&b, &at_b), threshold < 0.0, &options, start);
        self.solved += 1;
        self.nearest = self.nearest.min(found.upper + pair.error - pair.pair.padding_m);
        if let Some(n) = found.normal {
            self.workspace.normals[pair.index as usize] = n;
        }
        let ends = pair.approach <= self.resolution_m();
        if let Some(clearance) = self.free_by(pair, &found, ends) {
            return PairState::Free(clearance);
        }
        let mut is_contact = found.upper < threshold - pair.error;
        if !is_contact && threshold == 0.0 && found.upper <= 0.0 {
            is_contact = overlaps_by((&a, &pair.placed[0]), (&b, &pair.placed[1]), &found, pair.error);
            if !is_contact {
                found = solve((&a, &at_a), (&b, &at_b), true, &options, &mut WarmStart::default());
                is_contact = found.upper < -pair.error;
            }
        }
        if is_contact {
            PairState::Contact(self.contact_at(pair, &found), ends)
        } else {
            PairState::Open(ends.then(|| self.contact_at(pair, &found)))
        }
    }

    /// Whether the solver's answer proves that a pair keeps apart on the interval; by a clearance
    /// of any accuracy if this ends the search.
    fn free_by(&mut self, pair: &PairAt<'_>, found: &Solved, ends: bool) -> Option<f64> {
        if !self.options.certificate {
            let lower = found.lower - pair.error - pair.approach;
            let clearance = self.settled(pair, lower).or_else(|| self.settled_last(pair, lower, ends));
            if clearance.is_some() {
                return clearance;
            }
        }
        let n = found.normal?.try_normalize(0.0)?;
        // Far from settled planes do not help.
        let along = self.workspace.placing.approach_along_m(pair.pair, &pair.placed, &n);
        if !ends {
            self.settled(pair, found.lower - pair.error - along)?;
        }
        let problem = self.problem;
        let tangents = [0, 1].map(|side| match problem.piece(pair.pair.pieces[side]).1 {
            Piece::Body(body) if body.closed_form().is_none() => {
                let outward = if side == 0 { -n } else { n };
                Some(tangent(body, &pair.placed[side], (found, side), &outward))
            }
            _ => None,
        });
        let [of_a, of_b] = tangents.each_ref().map(|tangent| tangent.as_ref().map_or(Height::Table, Height::Tangent));
        let gap = self.planes(pair, &n, [of_a, of_b]);
        let lower = gap - pair.error - along;
        let clearance = self.settled(pair, lower).or_else(|| self.settled_last(pair, lower, ends))?;
        self.record(pair, &n, || Proof::Tangents(Box::new(tangents))).then_some(clearance)
    }

    /// Lower bound of the signed distance in the middle by planes, metres.
    fn planes(&self, pair: &PairAt<'_>, n: &Vector3<f64>, [of_a, of_b]: [Height<'_>; 2]) -> f64 {
        let [a, b] = pair.pair.pieces.map(|piece| self.problem.piece(piece).1);
        gap((&a, &pair.placed[0].pose, of_a), (&b, &pair.placed[1].pose, of_b), n)
    }

    /// The clearance of a pair whose signed distance is at least `lower` on the interval, if that
    /// is enough.
    fn settled(&self, pair: &PairAt<'_>, lower: f64) -> Option<f64> {
        let clearance = lower - pair.pair.padding_m;
        let accuracy = self.options.clearance_accuracy_m;
        let is_close = accuracy.is_none_or(|accuracy| clearance >= self.nearest - accuracy);
        (lower > pair.pair.threshold_m && is_close).then_some(clearance)
    }

    /// The same of any accuracy, where a pair is not looked at again.
    fn settled_last(&self, pair: &PairAt<'_>, lower: f64, ends: bool) -> Option<f64> {
        (ends && lower > pair.pair.threshold_m).then_some(lower - pair.pair.padding_m)
    }

    /// The same from planes across n in the middle.
    fn settled_along(&self, pair: &PairAt<'_>, gap: f64, n: &Vector3<f64>) -> Option<f64> {
        let lower = gap - pair.error;
        // Both sums are bounds; the cheaper one first.
        self.settled(pair, lower - pair.approach).or_else(|| {
            self.settled(pair, lower)?;
            self.settled(pair, lower - self.workspace.placing.approach_along_m(pair.pair, &pair.placed, n))
        })
    }

    /// Writes down what keeps a pair apart, if that is asked for and a verifier will see it, too.
    fn record(&mut self, pair: &PairAt<'_>, n: &Vector3<f64>, proof: impl FnOnce() -> Proof) -> bool {
        if !self.options.certificate {
            return true;
        }
        let record = Record { interval: pair.interval, pair: pair.index, normal: (*n).into(), proof: proof() };
        let is_apart = |lower: f64| lower > pair.pair.threshold_m;
        let holds = is_apart(record.lower_m(self.problem, &mut self.workspace.placing, is_apart));
        if holds {
            self.records.push(record);
        }
        holds
    }

    fn contact_at(&self, pair: &PairAt<'_>, found: &Solved) -> MotionContact {
        MotionContact {
            s: self.workspace.placing.s(),
            items: self.problem.items(pair.pair),
            lower_m: found.lower,
            upper_m: found.upper,
            witnesses: found.witnesses,
            normal: found.normal,
        }
    }

    fn answer(&mut self, ended_early: bool) -> MotionAnswer {
        let rest: Vec<Interval> = self.workspace.queue.iter().map(|(interval, _)| *interval).collect();
        for interval in rest {
            if !self.is_beyond_contact(&interval) {
                self.leave(&interval);
            }
        }
        let contact = self.contact.take();
        let verdict = match (&contact, self.is_unproven) {
            (Some(_), _) => MotionVerdict::Contact,
            (None, true) => MotionVerdict::Undecided,
            (None, false) => MotionVerdict::Free,
        };
        let alpha = contact.as_ref().map_or(self.alpha, |contact| self.alpha.min(contact.s));
        let open = self.open.take();
        let (contact, open) = match contact {
            Some(contact) => (Some(contact.clone()), open.filter(|open| open.s < contact.s)),
            None => (open, None),
        };
        let is_certified = self.options.certificate && verdict == MotionVerdict::Free;
        let records = std::mem::take(&mut self.records);
        MotionAnswer {
            verdict,
            alpha,
            clearance_lower_m: self.clearance,
            contact,
            open,
            ended_early,
            configurations: self.configurations,
            solved: self.solved,
            certificate: is_certified.then(|| Box::new(Certificate::new(self.problem, self.path, records))),
        }
    }
}

/// A pair on an interval.
struct PairAt<'a> {
    pair: &'a PiecePair,
    index: u32,
    placed: [PlacedPiece; 2],
    /// How much nearer it can get, metres.
    approach: f64,
    /// Bound of the error of both poses, metres.
    error: f64,
    interval: Interval,
}

/// What proves how far a body reaches along a unit vector of the world frame: the witness and the
/// constraints that the lower bound rests on, or a support point where it rests on none of these.
fn tangent(body: &Body, placed: &PlacedPiece, (found, side): (&Solved, usize), outward: &Vector3<f64>) -> Tangent {
    let mut multipliers: Vec<_> = found.active[side].iter().collect();
    let mut point = Placing::local(placed, &found.witnesses[side]);
    if multipliers.is_empty() {
        let own = placed.pose.rotation().inverse_transform_vector(outward);
        (point, multipliers) = body.support_multipliers(&own);
    }
    Tangent { point: point.into(), multipliers }
}

/// Whether a common point lies in one of two overlapping bodies so deep that they overlap wherever
/// their poses are within an error.
fn overlaps_by(a: (&Piece<'_>, &PlacedPiece), b: (&Piece<'_>, &PlacedPiece), found: &Solved, error_m: f64) -> bool {
    [(a, found.witnesses[0]), (b, found.witnesses[1])].into_iter().any(|((piece, placed), witness)| match piece {
        Piece::Body(body) => {
            let own = Placing::local(placed, &witness);
            let rounding = 64.0 * f64::EPSILON * (witness.norm() + own.norm() + placed.pose.translation().norm());
            body.value_upper_within(&own, 2.0 * error_m + rounding) <= 1.0
        }
        _ => false,
    })
}
