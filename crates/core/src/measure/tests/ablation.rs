//! What each stage of a search is there for: each is switched off alone, and the queries at which
//! it came to its turn are solved once more, from the same hint.
//!
//! The draws are those of the endurance bench, of a catalogue in which half the bodies have edges,
//! and the cases of the stability catalogue that ask for a distance. The table of docs/numerics.md:
//!
//! ```text
//! SUBLEVEL_LONG=1000000 cargo nextest run --release -p sublevel-core --lib --no-capture \
//!     -E 'test(every_stage_is_switched_off_alone)'
//! ```

#[path = "../../../../bench/benches/endurance/draw.rs"]
mod draw;

use crate::body::Body;
use crate::measure::solver::stages::{Stage, asked, except};
use crate::measure::*;
use draw::{Draw, Style};
use nalgebra::{UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Instant;
use sublevel_testkit::Seeded;
use sublevel_testkit::bodies::{self, b, c, cylinder, e, p, q};
use sublevel_testkit::catalogue::{Case, contact, placement, scale};
use sublevel_testkit::random::draws;

/// The stages of distances, level and growth distances, and decisions, in the order in which they
/// are tried.
const STAGES: [Stage; 17] = [
    Stage::Balls,
    Stage::Planes,
    Stage::ClosedForm,
    Stage::Follow,
    Stage::Seek,
    Stage::Edges,
    Stage::Newton,
    Stage::SupportTables,
    Stage::Ray,
    Stage::Deepest,
    Stage::InteriorDistance,
    Stage::InteriorLevel,
    Stage::Refinement,
    Stage::Alignment,
    Stage::Again,
    Stage::UnsureDeepest,
    Stage::ExactLevel,
];

/// Queries of one pair before the next is drawn.
const ROUND: u32 = 250;

fn pose(translation: Vector3<f64>, rotation: &UnitQuaternion<f64>) -> Pose {
    Pose::from_quaternion(translation, rotation.coords.into()).unwrap()
}

fn shifted(from: &Pose, by: Vector3<f64>) -> Pose {
    pose(from.translation() + by, from.rotation())
}

fn turned(from: &Pose, by: Vector3<f64>) -> Pose {
    pose(*from.translation(), &(UnitQuaternion::from_scaled_axis(by) * from.rotation()))
}

/// The queries that are put.
#[derive(Clone, Copy, Debug)]
enum Query {
    Distance,
    Level,
    Growth,
    Overlap,
}

struct Answer {
    is_sure: bool,
    bracket: [f64; 2],
    iterations: u32,
}

impl Query {
    fn solve(self, a: (&Body, &Pose), b: (&Body, &Pose), options: &Options<'_>, warm: &mut WarmStart) -> Answer {
        let answer = |status, bracket, iterations| Answer { is_sure: status == Status::Converged, bracket, iterations };
        match self {
            Self::Distance => {
                let found = distance(a.0, a.1, b.0, b.1, options, warm);
                answer(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Level => {
                let found = level_distance(a.0, a.1, b.0, b.1, options, warm);
                answer(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Growth => {
                let found = growth_distance(a.0, a.1, b.0, b.1, options, warm);
                answer(found.status, [found.lower, found.upper], found.iterations)
            }
            Self::Overlap => match overlap(a.0, a.1, b.0, b.1, options, warm) {
                Decision::Yes => answer(Status::Converged, [0.0, 0.0], 0),
                Decision::No => answer(Status::Converged, [f64::MIN_POSITIVE, f64::INFINITY], 0),
                Decision::Undecided { lower, upper } => answer(Status::BracketWide, [lower, upper], 0),
            },
        }
    }
}

/// What is counted of one stage: the queries that it came to its turn in, and what became of them
/// without it.
#[derive(Default)]
struct Row {
    asked: u64,
    rescued: u64,
    wrong: u64,
    /// With the stage and without.
    iterations: [u64; 2],
    worst: [u32; 2],
    seconds: [f64; 2],
    /// The first that it rescued.
    first: Vec<String>,
}

#[derive(Default)]
struct Table {
    queries: u64,
    unsure: u64,
    iterations: u64,
    worst: u32,
    seconds: f64,
    rows: BTreeMap<usize, Row>,
}

impl Table {
    /// Solves with all stages, and once more without each that came to its turn.
    fn put(
        &mut self,
        query: Query,
        (a, b): ((&Body, &Pose), (&Body, &Pose)),
        options: &Options<'_>,
        warm: &mut WarmStart,
        what: impl Fn() -> String,
    ) {
        let hint = *warm;
        let timed = |warm: &mut WarmStart| {
            let start = Instant::now();
            let answer = query.solve(a, b, options, warm);
            (answer, start.elapsed().as_secs_f64())
        };
        let ((whole, seconds), stages) = asked(&STAGES, || timed(warm));
        self.queries += 1;
        self.unsure += u64::from(!whole.is_sure);
        self.iterations += u64::from(whole.iterations);
        self.worst = self.worst.max(whole.iterations);
        self.seconds += seconds;
        for stage in stages {
            let (part, without) = except(&[stage], || timed(&mut hint.clone()));
            let row = self.rows.entry(stage as usize).or_default();
            row.asked += 1;
            let is_wrong = part.bracket[0] > whole.bracket[1] || whole.bracket[0] > part.bracket[1];
            row.wrong += u64::from(is_wrong);
            assert!(!is_wrong, "without {stage:?}: {:?} for {:?}: {}", part.bracket, whole.bracket, what());
            if whole.is_sure && !part.is_sure {
                row.rescued += 1;
                if row.first.len() < 3 {
                    row.first.push(format!("{query:?} {}", what()));
                }
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

    fn print(&self, what: &str) {
        let Self { queries, unsure, iterations, worst, seconds, .. } = self;
        let mean = *iterations as f64 / *queries as f64;
        println!(
            "\n{what}: {queries} queries, {unsure} not converged, {mean:.3} iterations, worst {worst}, {seconds:.1} s"
        );
        println!(
            "| stage | came to its turn | rescued | wrong | iterations there, with and without | worst | time of all queries |"
        );
        println!("|---|---|---|---|---|---|---|");
        for stage in STAGES {
            let Some(row) = self.rows.get(&(stage as usize)) else { continue };
            let Row { asked, rescued, wrong, iterations, worst, seconds: [with, without], .. } = row;
            let [of_all, of_rest] = iterations.map(|sum| sum as f64 / *asked as f64);
            let ratio = (seconds + without - with) / seconds;
            println!(
                "| {stage:?} | {asked} | {rescued} | {wrong} | {of_all:.2}, {of_rest:.2} | {}, {} | {ratio:.3} |",
                worst[0], worst[1]
            );
        }
        for stage in STAGES {
            for first in self.rows.get(&(stage as usize)).iter().flat_map(|row| &row.first) {
                println!("{stage:?} rescues {first}");
            }
        }
    }
}

/// The body of that file, read once.
fn own(json: &str) -> &'static Body {
    static BODIES: Mutex<BTreeMap<String, &'static Body>> = Mutex::new(BTreeMap::new());
    let mut bodies = BODIES.lock().unwrap();
    bodies.entry(json.to_owned()).or_insert_with(|| Box::leak(Box::new(Body::from_json(json).unwrap())))
}

/// Sizes of 0.01 to 10, thin and round; half of them with edges.
fn bodies_of_the_soak() -> Vec<Body> {
    let mut smooth = vec![e(1.0, 1.0, 1.0), e(1.0, 0.7, 0.4), e(0.01, 0.01, 1.0), e(10.0, 6.0, 8.0)];
    for degree in [4, 6, 8] {
        smooth.extend([q(degree, 0.8, 0.5, 1.1), q(degree, 0.05, 0.05, 1.0), c(degree, 1.0, 0.05), p(degree, 0.7)]);
    }
    let edged = [
        b(0.6, 0.9, 0.3),
        b(1.0, 1.0, 1e-3),
        b(0.02, 0.03, 0.01),
        b(0.01, 0.01, 1.0),
        b(10.0, 6.0, 0.1),
        cylinder(0.5, 0.8),
        cylinder(0.01, 1.0),
        cylinder(1.0, 0.01),
        cylinder(5.0, 3.0),
    ];
    let all: Vec<_> = smooth.iter().chain(&edged).map(|body| own(&body.to_json()).clone()).collect();
    // Smooth bodies that cut each other, with edges and without a closed form.
    let cut = all.iter().filter(|body| body.name().starts_with('P')).flat_map(|body| {
        [Vector3::new(0.7, 0.7, 0.7), Vector3::new(0.5, 0.3, 1.0)].map(|half| {
            let round = Body::ellipsoid("round", Vector3::zeros(), half).unwrap();
            let constraints = vec![body.constraints()[0].clone(), round.constraints()[0].clone()];
            Body::new("cut", *round.normalization(), constraints).unwrap()
        })
    });
    let cut: Vec<_> = cut.collect();
    all.into_iter().chain(cut).collect()
}

/// Queries as the soak draws them: cold, from the answer before, and from hints of other poses.
fn soak(table: &mut Table, bodies: &[Body], seed: u64, count: u64) {
    let options = Options::default();
    let mut block = 0;
    while table.queries < count {
        let mut random = Seeded(seed ^ u64::wrapping_mul(block, 0xd134_2543_de82_ef95));
        let mut draw = Draw::new(bodies, &mut random);
        let Draw { a, b, measure, style, batches, .. } = draw;
        let query = [Query::Distance, Query::Level, Query::Growth][measure];
        let (mut warm, mut warm_overlap) = (WarmStart::default(), WarmStart::default());
        for round in 0..ROUND {
            let (pose_a, pose_b, continues) = draw.next();
            // Those of a batch have no hints.
            if batches || !continues && !round.is_multiple_of(4) {
                (warm, warm_overlap) = Default::default();
            }
            let pair = ((a, &pose_a), (b, &pose_b));
            let what = || {
                let pose = |pose: &Pose| {
                    format!("{:?} {:?}", pose.translation().as_slice(), pose.rotation().coords.as_slice())
                };
                format!("{style:?} {}-{}, block {block}, {}, {}", a.name(), b.name(), pose(&pose_a), pose(&pose_b))
            };
            table.put(query, pair, &options, &mut warm, what);
            if round.is_multiple_of(4) || style == Style::Trajectory {
                table.put(Query::Overlap, pair, &options, &mut warm_overlap, what);
            }
        }
        block += 1;
    }
}

/// The cases of the stability catalogue that ask for a distance, at their accuracies.
fn families(table: &mut Table, count: u64) {
    let zoo = bodies::zoo();
    let mut put = |family: u8, cases: &mut dyn Iterator<Item = Vec<Case>>| {
        for case in cases.flatten() {
            let (a, b) = (own(&case.a.to_json()), own(&case.b.to_json()));
            let (pose_a, pose_b) = (
                pose(*case.pose_a.translation(), case.pose_a.rotation()),
                pose(*case.pose_b.translation(), case.pose_b.rotation()),
            );
            let options = Options::default().with_accuracy(case.accuracy).unwrap();
            let mut warm = WarmStart::default();
            let what = || format!("family {family}, {}", case.what);
            for query in [Query::Distance, Query::Level, Query::Growth, Query::Overlap] {
                table.put(query, ((a, &pose_a), (b, &pose_b)), &options, &mut warm, what);
                warm = WarmStart::default();
            }
        }
    };
    let random = |family: u64, index: u64| Seeded(1_000_000 * family + index);
    put(1, &mut (0..count.min(contact::KISSING)).map(|i| contact::kissing(i, None)));
    put(3, &mut (0..count.min(contact::PARALLEL_FACES)).map(|i| vec![contact::parallel_faces(i)]));
    put(5, &mut (0..count).map(|i| vec![placement::common_point(&zoo, &mut random(5, i))]));
    put(6, &mut (0..count.min(placement::ALONG_AN_AXIS)).map(|i| vec![placement::along_an_axis(i)]));
    put(
        7,
        &mut (0..count).map(|i| {
            let (mut random, i) = (random(7, i), i as usize);
            let (a, b) = (&zoo[i % zoo.len()], &zoo[i / 2 % zoo.len()]);
            vec![placement::concentric(a, b, placement::OFFSETS[i % 8], &mut random)]
        }),
    );
    put(8, &mut (0..count).map(|i| vec![contact::touching(contact::TOUCHING[i as usize % 5], &mut random(8, i))]));
    put(9, &mut (0..count).map(|i| scale::ratio(i, &mut random(9, i)).into()));
    put(10, &mut (0..count).map(|i| scale::far_from_the_origin(i as i32 % 10, &mut random(10, i)).into()));
    put(
        12,
        &mut (0..count).map(|i| {
            let (k, aspect) = (i as usize, 10_f64.powi(2 + (i % 4) as i32));
            let pair = (k / 4 % scale::NEEDLES, k / 20 % scale::PARTNERS);
            scale::needles(aspect, pair, k / 140 % scale::NEEDLE_SETTINGS, &mut random(12, i))
        }),
    );
    put(13, &mut (0..count.min(contact::PARALLEL_FLATS)).map(|i| vec![contact::parallel_flats(i)]));
    put(14, &mut (0..count.min(contact::TIPS)).map(|i| vec![contact::tips(i, &mut random(14, i))]));
    put(15, &mut (0..count).map(|i| vec![contact::smooth(i, &mut random(15, i))]));
}

#[test]
fn every_stage_is_switched_off_alone() {
    let count = draws(2_000);
    let mut table = Table::default();
    soak(&mut table, &bodies_of_the_soak(), 1, count);
    table.print("draws of the soak");
    let mut table = Table::default();
    families(&mut table, if count > 100_000 { 700 } else { 10 });
    table.print("stability families");
}
