//! One block: ten thousand queries of one pair, each answer checked cheaply and one of them thoroughly.

use crate::draw::{Draw, Style};
use crate::measures::{Answer, MEASURES};
use crate::tally::{Tally, Worst};
use sublevel::body::Body;
use sublevel::measure::{MAX_ITERATIONS, Options, Pose, WarmStart};

/// Solves of one block.
pub(crate) const SOLVES: u64 = 10_000;

/// Runs a block; `program` says whether its thorough check includes the semidefinite program.
pub(crate) fn run(bodies: &[Body], seed: u64, block: u64, program: bool) -> Tally {
    let mut tally = Tally::default();
    let mut draw = Draw::new(bodies, MEASURES.len(), seed, block);
    let (a, b, measure) = (draw.a, draw.b, &MEASURES[draw.measure]);
    let options = Options::default();
    let thorough = draw.random.next() % SOLVES;
    let (mut warm, mut examined) = (WarmStart::default(), false);
    let mut query = 0;
    while tally.solves < SOLVES {
        let (pose_a, pose_b, continues) = draw.next();
        let (p, q) = ((a, &pose_a), (b, &pose_b));
        // A hint that does not continue is a bad one, which may change nothing but the time.
        let hinted = continues || query % 4 == 0;
        let mut start = if hinted { warm } else { WarmStart::default() };
        let answer = (measure.solve)(p, q, &options, &mut start);
        warm = start;
        let name = |kind: &str| format!("{}, {kind}", measure.name);
        let kind = if continues {
            "warm"
        } else if hinted {
            "bad hint"
        } else {
            "cold"
        };
        let worst = Worst { iterations: answer.iterations(), block, query };
        tally.solve(name(kind), worst);
        let site = Site { a, pose_a: &pose_a, b, pose_b: &pose_b, style: draw.style, block, query };
        site.cheap(&mut tally, measure.name, &answer);
        // Every hinted answer off a trajectory, and every tenth on one, is held against a cold one.
        if hinted && (!continues || query % 10 == 0) {
            let cold = (measure.solve)(p, q, &options, &mut WarmStart::default());
            tally.solve(name("cold"), Worst { iterations: cold.iterations(), block, query });
            site.cheap(&mut tally, measure.name, &cold);
            let ((l, u), (m, v)) = (answer.bracket(), cold.bracket());
            let meet = l <= v && m <= u;
            tally.check("warm and cold brackets meet", meet, block, query, || site.tell(&cold));
        }
        if query % 16 == 0 {
            tally.check("witnesses feasible", answer.feasible(p, q), block, query, || site.tell(&answer));
        }
        if !examined && tally.solves > thorough {
            examined = true;
            site.thorough(&mut tally, &answer);
            if program {
                site.program(&mut tally, draw.measure, &answer);
            }
        }
        query += 1;
    }
    tally
}

/// Where an answer is from.
struct Site<'a> {
    a: &'a Body,
    pose_a: &'a Pose,
    b: &'a Body,
    pose_b: &'a Pose,
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

    fn cheap(&self, tally: &mut Tally, name: &str, answer: &Answer) {
        let (lower, upper) = answer.bracket();
        let mut check = |kind: &str, passed: bool| {
            tally.check(kind, passed, self.block, self.query, || self.tell(answer));
        };
        check("bracket in order", lower <= upper);
        check(&format!("{name} converged"), answer.converged());
        let narrow = upper - lower <= answer.tolerance(self.a, self.b, Options::default().accuracy());
        check("status honest", narrow || !answer.converged());
        check("iterations capped", answer.iterations() <= MAX_ITERATIONS);
    }

    fn thorough(&self, tally: &mut Tally, answer: &Answer) {
        let verdict = answer.verdict((self.a, self.pose_a), (self.b, self.pose_b));
        let tell = || format!("truth {:e}: {}", verdict.truth, self.tell(answer));
        tally.check("truth with 200 bits in the bracket", verdict.inside, self.block, self.query, tell);
        tally.check("reference sharp", verdict.sharp, self.block, self.query, tell);
    }

    #[cfg(feature = "fit")]
    fn program(&self, tally: &mut Tally, measure: usize, answer: &Answer) {
        let Some(program) = MEASURES[measure].program else { return };
        let Some((value, size)) = answer.comparable(self.a, self.b) else { return };
        match program((self.a, self.pose_a), (self.b, self.pose_b)) {
            Some(arbiter) => {
                let deviation = (value - arbiter).abs() / size;
                tally.deviation = tally.deviation.max(deviation);
                let tell = || format!("arbiter {arbiter:e}: {}", self.tell(answer));
                tally.check("semidefinite program agrees to 1e-6", deviation <= 1e-6, self.block, self.query, tell);
            }
            None => tally.check("semidefinite program solved", false, self.block, self.query, || self.tell(answer)),
        }
    }

    #[cfg(not(feature = "fit"))]
    fn program(&self, _: &mut Tally, _: usize, _: &Answer) {}
}
