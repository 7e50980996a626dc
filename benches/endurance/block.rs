//! One block: ten thousand solves, each answer checked cheaply and one of them thoroughly.

use crate::draw::{Draw, Style};
use crate::measures::{Answer, MEASURES};
use crate::random::Seeded;
use crate::tally::{Tally, Worst};
use sublevel::body::Body;
use sublevel::measure::{MAX_ITERATIONS, Options, Pose, WarmStart};

/// Solves of one block.
pub(crate) const SOLVES: u64 = 10_000;

/// Solves of one pair before the next is drawn.
const ROUND: u64 = 250;

/// Runs a block; `program` says whether its thorough check includes the semidefinite program.
pub(crate) fn run(bodies: &[Body], seed: u64, block: u64, program: bool) -> Tally {
    let mut random = Seeded(seed ^ block.wrapping_mul(0xd134_2543_de82_ef95));
    let mut tally = Tally::default();
    let mut examine = Some(random.next() % SOLVES);
    let mut query = 0;
    while tally.solves < SOLVES {
        let until = (tally.solves + ROUND).min(SOLVES);
        let draw = Draw::new(bodies, MEASURES.len(), &mut random);
        round(draw, &mut tally, (block, &mut query), until, (&mut examine, program));
    }
    tally
}

/// Runs the queries of one pair until so many solves are counted; the first one after `examine` solves is checked thoroughly.
fn round(
    mut draw: Draw<'_, '_>,
    tally: &mut Tally,
    (block, query): (u64, &mut u64),
    until: u64,
    (examine, program): (&mut Option<u64>, bool),
) {
    let (a, b, measure) = (draw.a, draw.b, &MEASURES[draw.measure]);
    let options = Options::default();
    let mut warm = WarmStart::default();
    while tally.solves < until {
        let (pose_a, pose_b, continues) = draw.next();
        let (p, q) = ((a, &pose_a), (b, &pose_b));
        let site = Site { a, pose_a: &pose_a, b, pose_b: &pose_b, style: draw.style, block, query: *query };
        let solve = |tally: &mut Tally, kind: &str, start: &mut WarmStart| {
            let answer = (measure.solve)(p, q, &options, start);
            let worst = Worst { iterations: answer.iterations(), block, query: *query };
            tally.solve(format!("{}, {kind}", measure.name), worst);
            site.cheap(tally, measure.name, &answer);
            answer
        };
        // A hint that does not continue is a bad one, which may change nothing but the time.
        let hinted = continues || query.is_multiple_of(4);
        let answer = if hinted {
            solve(tally, if continues { "warm" } else { "bad hint" }, &mut warm)
        } else {
            warm = WarmStart::default();
            solve(tally, "cold", &mut warm)
        };
        // Every hinted answer off a trajectory, and every tenth on one, is held against a cold one.
        if hinted && (!continues || query.is_multiple_of(10)) {
            let cold = solve(tally, "cold", &mut WarmStart::default());
            let ((l, u), (m, v)) = (answer.bracket(), cold.bracket());
            let meet = l <= v && m <= u;
            tally.check("warm and cold brackets meet", meet, block, *query, || site.tell(&cold));
        }
        if query.is_multiple_of(16) {
            tally.check("witnesses feasible", answer.feasible(p, q), block, *query, || site.tell(&answer));
        }
        if examine.is_some_and(|after| tally.solves > after) {
            *examine = None;
            site.thorough(tally, &answer);
            if program {
                site.program(tally, draw.measure, &answer);
            }
        }
        *query += 1;
    }
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
