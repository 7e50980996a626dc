//! One block: ten thousand solves, each answer checked cheaply and one of them thoroughly.

use crate::draw::{Draw, Style};
use crate::measures::{Answer, MEASURES};
use crate::tally::{Check, Iterations, Tally, Worst};
use crate::verdict::Verdict;
use sublevel::body::Body;
use sublevel::measure::{
    Decision, Distance, MAX_ITERATIONS, Options, Pose, WarmStart, distance_batch, nearer_than, overlap,
};
use sublevel_testkit::random::{Seeded, pose};

/// Solves of one block.
pub(crate) const SOLVES: u64 = 10_000;

/// Solves of one pair before the next is drawn.
const ROUND: u64 = 250;

/// Thresholds of decisions, in parts of the distance.
const THRESHOLDS: [f64; 5] = [0.5, 0.999, 1.0, 1.001, 2.0];

/// Poses of one batch.
const BATCH: usize = 64;

/// Where a solve starts from.
#[derive(Clone, Copy)]
enum Start {
    Cold,
    Warm,
    /// From a hint that has nothing to do with the poses, which may change nothing but the time.
    BadHint,
    Batch,
}

const STARTS: [(Start, &str); 4] =
    [(Start::Cold, "cold"), (Start::Warm, "warm"), (Start::BadHint, "bad hint"), (Start::Batch, "batch")];

/// Runs a block; `program` says whether its thorough check includes the semidefinite program.
pub(crate) fn run(bodies: &[Body], seed: u64, block: u64, program: bool) -> Tally {
    let mut random = Seeded(seed ^ block.wrapping_mul(0xd134_2543_de82_ef95));
    let mut tally = Tally::default();
    let mut examine = Some(random.next() % SOLVES);
    let mut query = 0;
    while tally.solves < SOLVES {
        let mut draw = Draw::new(bodies, &mut random);
        let Draw { a, b, measure, .. } = draw;
        draw.aim = MEASURES[measure].aim.unwrap_or(draw.aim);
        let mut round = Round {
            tally: &mut tally,
            iterations: Default::default(),
            block,
            query: &mut query,
            examine: &mut examine,
            program,
        };
        if draw.batches {
            round.batches(draw);
        } else {
            round.one_by_one(draw);
        }
        let iterations = round.iterations;
        let kind = if a.is_smooth() && b.is_smooth() { "smooth" } else { "edges" };
        for ((_, start), iterations) in STARTS.iter().zip(iterations) {
            tally.iterations(format!("{}, {kind}, {start}", MEASURES[measure].name), iterations);
        }
    }
    tally
}

/// The queries of one pair.
struct Round<'t> {
    tally: &'t mut Tally,
    /// By [`Start`].
    iterations: [Iterations; STARTS.len()],
    block: u64,
    query: &'t mut u64,
    /// After so many solves one is checked thoroughly.
    examine: &'t mut Option<u64>,
    /// Whether also by a semidefinite program.
    program: bool,
}

impl Round<'_> {
    /// Solves one pose after the other, cold, warm and from bad hints.
    fn one_by_one(&mut self, mut draw: Draw<'_, '_>) {
        let until = (self.tally.solves + ROUND).min(SOLVES);
        let Draw { a, b, measure, style, .. } = draw;
        let options = Options::default();
        let mut warm = WarmStart::default();
        while self.tally.solves < until {
            let (pose_a, pose_b, continues) = draw.next();
            let site =
                Site { a, pose_a: &pose_a, b, pose_b: &pose_b, measure, style, block: self.block, query: *self.query };
            let hinted = continues || self.query.is_multiple_of(4);
            let start = match (hinted, continues) {
                (false, _) => Start::Cold,
                (true, true) => Start::Warm,
                (true, false) => Start::BadHint,
            };
            if !hinted {
                warm = WarmStart::default();
            }
            let answer = (MEASURES[measure].solve)((a, &pose_a), (b, &pose_b), &options, &mut warm);
            self.count(&site, start, &answer);
            if let Answer::Distance(found) = &answer {
                self.decide(&site, found, &warm);
            }
            // Every hinted answer off a trajectory, and every tenth on one, is compared with a cold
            // one.
            if hinted && (!continues || self.query.is_multiple_of(10)) {
                self.meet(&site, &answer);
            }
        }
    }

    /// Solves the poses of a few batches.
    fn batches(&mut self, mut draw: Draw<'_, '_>) {
        let until = (self.tally.solves + ROUND).min(SOLVES);
        let Draw { a, b, measure, style, .. } = draw;
        while self.tally.solves < until {
            let (pose_a, first, _) = draw.next();
            let mut poses = [first; BATCH];
            for pose in &mut poses[1..] {
                let (one, two, _) = draw.next();
                *pose = seen_from(&pose_a, &one, &two);
            }
            let mut answers = [Distance::default(); BATCH];
            distance_batch(a, &pose_a, b, &poses, &Options::default(), &mut answers).expect("as many places as poses");
            for (pose_b, answer) in poses.iter().zip(answers) {
                let site =
                    Site { a, pose_a: &pose_a, b, pose_b, measure, style, block: self.block, query: *self.query };
                let answer = Answer::Distance(answer);
                self.count(&site, Start::Batch, &answer);
                if self.query.is_multiple_of(32) {
                    self.meet(&site, &answer);
                }
            }
        }
    }

    /// Counts an answer and checks it.
    fn count(&mut self, site: &Site<'_>, start: Start, answer: &Answer) {
        self.solved(site, start, answer);
        if self.query.is_multiple_of(16) {
            let feasible = answer.feasible((site.a, site.pose_a), (site.b, site.pose_b));
            self.tally.check(Check::Feasible, feasible, (site.block, site.query), || site.tell(answer));
        }
        if self.examine.is_some_and(|after| self.tally.solves > after) {
            *self.examine = None;
            site.thorough(self.tally, answer);
            if self.program {
                site.program(self.tally, answer);
            }
        }
        *self.query += 1;
    }

    /// Solves once more, cold and alone: both answers hold.
    fn meet(&mut self, site: &Site<'_>, answer: &Answer) {
        let (p, q) = ((site.a, site.pose_a), (site.b, site.pose_b));
        let cold = (MEASURES[site.measure].solve)(p, q, &Options::default(), &mut WarmStart::default());
        self.solved(site, Start::Cold, &cold);
        let ((l, u), (m, v)) = (answer.bracket(), cold.bracket());
        self.tally.check(Check::Meet, l <= v && m <= u, (site.block, site.query), || site.tell(&cold));
    }

    /// Asks which side of contact, and of a distance near the one that was found, from the hint of
    /// that and from nothing but the poses.
    fn decide(&mut self, site: &Site<'_>, found: &Distance, warm: &WarmStart) {
        let (p, q) = ((site.a, site.pose_a), (site.b, site.pose_b));
        let (options, mut hint) = (Options::default(), *warm);
        let cold = self.query.is_multiple_of(2);
        if cold {
            hint = WarmStart::default();
        }
        let contact = overlap(p.0, p.1, q.0, q.1, &options, &mut hint);
        if cold {
            hint = WarmStart::default();
        }
        let threshold = found.upper * THRESHOLDS[(*self.query / 2) as usize % THRESHOLDS.len()];
        let nearer = nearer_than(p.0, p.1, q.0, q.1, threshold, &options, &mut hint).expect("a distance");
        let width = Options::default().accuracy() * site.a.circumscribed().radius.min(site.b.circumscribed().radius);
        let open = |lower: f64, upper: f64| upper - lower <= width * (1.0 + 1e-12);
        let agree = match contact {
            Decision::Yes => found.lower <= 0.0,
            Decision::No => found.upper > 0.0,
            Decision::Undecided { lower, upper } => lower <= 0.0 && open(lower, upper),
        } && match nearer {
            Decision::Yes => found.lower < threshold,
            Decision::No => found.upper >= threshold,
            Decision::Undecided { lower, upper } => lower < threshold && threshold <= upper && open(lower, upper),
        };
        let detail =
            || format!("{contact:?}, below {threshold:e} m {nearer:?}: {}", site.tell(&Answer::Distance(*found)));
        self.tally.check(Check::Decision, agree, (site.block, site.query), detail);
    }

    fn solved(&mut self, site: &Site<'_>, start: Start, answer: &Answer) {
        self.tally.solves += 1;
        let worst = Worst { iterations: answer.iterations(), block: site.block, query: site.query };
        self.iterations[start as usize].count(worst);
        let message =
            || format!("{}, {}: {}", MEASURES[site.measure].name, STARTS[start as usize].1, site.tell(answer));
        self.tally.slow(worst, message);
        site.cheap(self.tally, answer);
    }
}

/// The pose of B beside A at `pose_a` that stands to it as `two` to `one`.
fn seen_from(pose_a: &Pose, one: &Pose, two: &Pose) -> Pose {
    let turn = pose_a.rotation() * one.rotation().inverse();
    pose(pose_a.translation() + turn * (two.translation() - one.translation()), &(turn * two.rotation()))
}

/// Where an answer is from.
struct Site<'a> {
    a: &'a Body,
    pose_a: &'a Pose,
    b: &'a Body,
    pose_b: &'a Pose,
    measure: usize,
    style: Style,
    block: u64,
    query: u64,
}

impl Site<'_> {
    fn tell(&self, answer: &Answer) -> String {
        let pose = |pose: &Pose| format!("{:?} {:?}", pose.translation().as_slice(), pose.rotation().coords.as_slice());
        let (a, b) = (self.a, self.b);
        let names = format!("{} {}-{} {}", a.name(), &a.id().to_string()[..8], b.name(), &b.id().to_string()[..8]);
        format!("{:?} {names}: {answer:?}; {}; {}", self.style, pose(self.pose_a), pose(self.pose_b))
    }

    fn cheap(&self, tally: &mut Tally, answer: &Answer) {
        let (lower, upper) = answer.bracket();
        let mut check = |check: Check, passed: bool| {
            tally.check(check, passed, (self.block, self.query), || self.tell(answer));
        };
        check(Check::InOrder, lower <= upper);
        check(Check::Converged, answer.converged((self.a, self.pose_a), (self.b, self.pose_b)));
        check(Check::Honest, answer.is_honest(self.a, self.b));
        check(Check::Capped, answer.iterations() <= MAX_ITERATIONS);
    }

    fn thorough(&self, tally: &mut Tally, answer: &Answer) {
        let Some(verdict) = Verdict::of(answer, (self.a, self.pose_a), (self.b, self.pose_b)) else { return };
        let tell = || format!("truth {:e}: {}", verdict.truth, self.tell(answer));
        tally.check(Check::Truth, verdict.inside, (self.block, self.query), tell);
        tally.check(Check::Decided, verdict.decided, (self.block, self.query), tell);
    }

    fn program(&self, tally: &mut Tally, answer: &Answer) {
        let Some(program) = MEASURES[self.measure].program else { return };
        let Some((value, size)) = answer.comparable(self.a, self.b) else { return };
        let arbiter = program((self.a, self.pose_a), (self.b, self.pose_b));
        tally.check(Check::Solved, arbiter.is_some(), (self.block, self.query), || self.tell(answer));
        if let Some(arbiter) = arbiter {
            let deviation = (value - arbiter).abs() / size;
            tally.deviation = tally.deviation.max(deviation);
            let tell = || format!("arbiter {arbiter:e}: {}", self.tell(answer));
            tally.check(Check::Agrees, deviation <= 1e-6, (self.block, self.query), tell);
        }
    }
}
