//! Motions against dense samples, closed forms, and certificates that were changed.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde_json::Value;
use sublevel_core::body::{Body, Compound, Shape};
use sublevel_core::measure::{Capsule, HalfSpace, Options, Pose, WarmStart};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::at;

mod free_joints;

use super::placing::Placing;
use super::solve::solve;
use super::*;
use crate::description::{Description, Joint, JointKind, Limits, Link, Mimic};
use crate::kinematics::Kinematics;
use crate::kinematics::tests::{configuration, tree};

fn solid(body: Body) -> MotionShape {
    MotionShape::Solid(Arc::new(Shape::Body(Box::new(body))))
}

fn ball(radius: f64) -> MotionShape {
    solid(Body::ball("ball", Vector3::zeros(), radius).expect("a ball"))
}

/// An arm of two links of length 1 m in the xy plane that turns about z, on a slide along z, with a
/// ball of radius 0.1 m at its end.
fn arm() -> Arc<Kinematics> {
    let joint = |name: &str, kind, child: usize, x: f64| Joint {
        name: name.into(),
        kind,
        parent: child - 1,
        child,
        origin: Isometry3::translation(x, 0.0, 0.0),
        axis: Vector3::z_axis(),
        limits: (kind != JointKind::Continuous).then_some(Limits { lower: -4.0, upper: 4.0 }),
        mimic: None,
    };
    let links = ["base", "slide", "upper", "lower"].map(|name| Link { name: name.into(), collisions: Vec::new() });
    let joints = vec![
        joint("slide", JointKind::Prismatic, 1, 0.0),
        joint("shoulder", JointKind::Revolute, 2, 0.0),
        joint("elbow", JointKind::Continuous, 3, 1.0),
    ];
    Arc::new(Kinematics::new(&Description { name: "arm".into(), links: links.into(), joints }).expect("a tree"))
}

fn hand(shape: MotionShape) -> Vec<MotionBody> {
    vec![MotionBody { name: "hand".into(), link: 3, place: at(1.0, 0.0, 0.0), shape }]
}

fn still(name: &str, shape: MotionShape, pose: Pose) -> MotionObstacle {
    MotionObstacle { name: name.into(), placed: PlacedObstacle::Still(shape, pose) }
}

fn of_arm(bodies: Vec<MotionBody>) -> MotionRobot {
    MotionRobot { kinematics: arm(), base: Pose::identity(), bodies }
}

fn problem(bodies: Vec<MotionBody>, obstacles: Vec<MotionObstacle>, margin_m: f64) -> MotionProblem {
    MotionProblem::new(of_arm(bodies), obstacles, margin_m, |_, _| Some(0.0)).expect("a problem")
}

fn edge(problem: &MotionProblem, from: &[f64], to: &[f64]) -> Path {
    Path::waypoints(problem.kinematics(), [from, to].concat()).expect("a path")
}

fn prove(problem: &MotionProblem, path: &Path, options: &MotionOptions<'_>) -> MotionAnswer {
    problem.prove(path, options, &mut MotionWorkspace::default())
}

const FIRST: MotionOptions<'static> = MotionOptions {
    resolution_m: 1e-6,
    max_configurations: 100_000,
    first_contact: true,
    clearance_accuracy_m: None,
    certificate: false,
    stop: None,
};

#[test]
fn first_contacts_of_a_turning_ball_are_where_they_must_be() {
    // The hand is at radius 2 on a circle; a ball of radius 0.2 stands on it at 90 degrees. Their
    // centres are 0.3 apart where the chord is, 2 * 2 sin(angle / 2) = 0.3.
    let apart = 2.0 * (0.3_f64 / 4.0).asin();
    let obstacles = || vec![still("post", ball(0.2), at(0.0, 2.0, 0.0))];
    for (margin, more) in
        [(0.0, 0.0), (0.05, 2.0 * (0.35_f64 / 4.0).asin() - apart), (-0.05, 2.0 * (0.25_f64 / 4.0).asin() - apart)]
    {
        let problem = problem(hand(ball(0.1)), obstacles(), margin);
        let path = edge(&problem, &[0.0, 0.0, 0.0], &[0.0, 3.0, 0.0]);
        let expected = (std::f64::consts::FRAC_PI_2 - apart - more) / 3.0;
        let found = prove(&problem, &path, &FIRST);
        assert_eq!(found.verdict, MotionVerdict::Contact, "margin {margin}");
        let contact = found.contact.expect("a contact");
        assert!(
            found.alpha <= expected + 1e-9 && expected <= contact.s + 1e-9,
            "{} {expected} {}",
            found.alpha,
            contact.s
        );
        assert!(contact.s - found.alpha < 1e-5, "margin {margin}: {} {}", found.alpha, contact.s);
        assert_eq!(contact.items, [MotionItem::Body(0), MotionItem::Obstacle(0)]);
        let quick = prove(&problem, &path, &MotionOptions { first_contact: false, ..FIRST });
        assert_eq!(quick.verdict, MotionVerdict::Contact);
        assert!(quick.configurations < found.configurations && quick.alpha <= expected + 1e-9);
        // Until before the first contact it is free, by as much as the chord says.
        let path = edge(&problem, &[0.0, 0.0, 0.0], &[0.0, 3.0 * (expected - 1e-3), 0.0]);
        let precise = MotionOptions { clearance_accuracy_m: Some(1e-5), ..FIRST };
        let free = prove(&problem, &path, &precise);
        assert_eq!((free.verdict, free.alpha), (MotionVerdict::Free, 1.0), "margin {margin}");
        let least = 4.0 * (0.5 * (apart + more + 3e-3)).sin() - 0.3;
        assert!(
            free.clearance_lower_m <= least && free.clearance_lower_m > least - 2e-5,
            "{} {least}",
            free.clearance_lower_m
        );
        assert!(free.clearance_lower_m >= margin);
    }
}

#[test]
fn a_near_miss_before_the_first_contact_is_told() {
    // The hand passes one ball at 20 µm, 0.5 rad on its way, and meets another at 90 degrees.
    let miss = 2.3 + 2e-5;
    let posts = vec![
        still("near", ball(0.2), at(miss * 0.5_f64.cos(), miss * 0.5_f64.sin(), 0.0)),
        still("post", ball(0.2), at(0.0, 2.0, 0.0)),
    ];
    let problem = problem(hand(ball(0.1)), posts, 0.0);
    let path = edge(&problem, &[0.0, 0.0, 0.0], &[0.0, 3.0, 0.0]);
    let expected = (std::f64::consts::FRAC_PI_2 - 2.0 * (0.3_f64 / 4.0).asin()) / 3.0;
    // Along the normal the hand moves by a second order only: much less than the resolution.
    let coarse = prove(&problem, &path, &MotionOptions { resolution_m: 0.05, ..FIRST });
    assert_eq!(coarse.verdict, MotionVerdict::Contact);
    let (contact, open) = (coarse.contact.expect("a contact"), coarse.open.expect("an open pair"));
    assert_eq!(contact.items[1], MotionItem::Obstacle(1));
    assert!(expected <= contact.s && contact.s - expected < 0.02, "{} {expected}", contact.s);
    assert_eq!(open.items[1], MotionItem::Obstacle(0));
    assert!(coarse.alpha <= open.s && (open.s - 0.5 / 3.0).abs() < 0.02 && open.s - coarse.alpha < 0.02, "{open:?}");
    assert!(open.lower_m > 0.0 && open.upper_m < 0.01, "{open:?}");
    // A finer resolution decides it, and the bracket closes.
    let fine = prove(&problem, &path, &FIRST);
    let contact = fine.contact.expect("a contact");
    assert!(
        fine.open.is_none() && fine.alpha <= expected && contact.s - fine.alpha < 1e-5,
        "{} {}",
        fine.alpha,
        contact.s
    );
    // Without a contact the answer names the open pair, as before.
    let short = edge(&problem, &[0.0, 0.0, 0.0], &[0.0, 1.0, 0.0]);
    let passing = prove(&problem, &short, &MotionOptions { resolution_m: 0.05, ..FIRST });
    assert_eq!((passing.verdict, passing.open), (MotionVerdict::Undecided, None));
    assert_eq!(passing.contact.expect("an open pair").items[1], MotionItem::Obstacle(0));
}

#[test]
fn slides_half_spaces_capsules_and_moving_obstacles() {
    // Down along z onto the ground at -1: the capsule lies along z, 0.3 and 0.1 below its centre.
    let capsule = MotionShape::Capsule(Capsule::new(0.1, 0.3).expect("a capsule"));
    let ground = HalfSpace::new(Vector3::z(), -1.0).expect("a half-space");
    let ground = MotionObstacle { name: "ground".into(), placed: PlacedObstacle::HalfSpace(ground, 0.0) };
    let down = problem(hand(capsule.clone()), vec![ground], 0.0);
    let path = edge(&down, &[0.0, 0.0, 0.0], &[-1.2, 0.0, 0.0]);
    let found = prove(&down, &path, &FIRST);
    let contact = found.contact.expect("a contact");
    assert!(found.alpha <= 0.5 && contact.s >= 0.5 && contact.s - found.alpha < 1e-5, "{} {}", found.alpha, contact.s);
    assert!((contact.normal.expect("a normal") - Vector3::z()).norm() < 1e-12);
    // A wall comes towards the robot, which stands still: it has 1.7 m to go and does 2 m.
    let wall = Body::cuboid("wall", Vector3::new(0.1, 3.0, 3.0)).expect("a box");
    let (from, to) = (at(4.0, 0.0, 0.0), at(2.0, 0.0, 0.0));
    let placed = PlacedObstacle::Moving { shape: solid(wall), from, to, place: Pose::identity() };
    let coming = vec![MotionObstacle { name: "wall".into(), placed }];
    let stands = problem(hand(capsule), coming, 0.0);
    let path = edge(&stands, &[0.0, 0.0, 0.0], &[0.0, 0.0, 0.0]);
    let found = prove(&stands, &path, &FIRST);
    let contact = found.contact.expect("a contact");
    let expected = (4.0 - 0.1 - 2.1) / 2.0;
    assert!(found.alpha <= expected && contact.s >= expected && contact.s - found.alpha < 1e-5);
    // A ball is held 2.9 m from the origin of a cart at (0, 2.4) that turns by a right angle: it
    // sweeps over the hand.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turned = Pose::from_quaternion(Vector3::new(0.0, 2.4, 0.0), [0.0, 0.0, -half, half]).expect("a pose");
    let (from, place) = (at(0.0, 2.4, 0.0), at(2.9, 0.0, 0.0));
    let placed = PlacedObstacle::Moving { shape: ball(0.2), from, to: turned, place };
    let carried = vec![MotionObstacle { name: "load".into(), placed }];
    let stands = problem(hand(ball(0.1)), carried, 0.0);
    let path = edge(&stands, &[0.0, 0.0, 0.0], &[0.0, 0.0, 0.0]);
    let found = prove(&stands, &path, &FIRST);
    // The hand's ball is 2 m along x from the origin; the load's centre is at (2.9 cos t, 2.4 - 2.9
    // sin t), t in [0, π/2].
    let gap = |s: f64| {
        let t = s * std::f64::consts::FRAC_PI_2;
        (2.9 * t.cos() - 2.0).hypot(2.4 - 2.9 * t.sin()) - 0.3
    };
    let contact = found.contact.expect("a contact");
    assert!(
        gap(found.alpha) >= -1e-9 && gap(contact.s) <= 1e-9 && contact.s - found.alpha < 1e-5,
        "{} {}",
        found.alpha,
        contact.s
    );
    // Two balls on one link never move against each other.
    let two = |x: f64| MotionBody { name: format!("{x}").into(), link: 2, place: at(x, 0.0, 0.0), shape: ball(0.1) };
    let rigid = problem(vec![two(0.0), two(0.5)], Vec::new(), 0.0);
    let precise = MotionOptions { clearance_accuracy_m: Some(1e-9), ..FIRST };
    let free = prove(&rigid, &edge(&rigid, &[0.0; 3], &[1.0, 3.0, 2.0]), &precise);
    assert_eq!((free.verdict, free.configurations), (MotionVerdict::Free, 1));
    assert!((free.clearance_lower_m - 0.3).abs() < 1e-9);
    let rigid = problem(vec![two(0.0), two(0.15)], Vec::new(), 0.0);
    let contact = prove(&rigid, &edge(&rigid, &[0.0; 3], &[1.0, 3.0, 2.0]), &FIRST);
    assert_eq!((contact.verdict, contact.alpha), (MotionVerdict::Contact, 0.0));
}

#[test]
fn bezier_segments_and_waypoints() {
    let post = vec![still("post", ball(0.2), at(0.0, 2.0, 0.0))];
    let problem = problem(hand(ball(0.1)), post, 0.0);
    // Lifts over the post while it turns.
    let control = vec![0.0, 0.0, 0.0, 1.5, 1.0, 0.0, 1.5, 2.0, 0.0, 0.0, 3.0, 0.0];
    let path = Path::bezier(problem.kinematics(), control.clone()).expect("a path");
    let found = prove(&problem, &path, &MotionOptions { certificate: true, ..FIRST });
    assert_eq!(found.verdict, MotionVerdict::Free);
    found.certificate.expect("a certificate").verify().expect("a proof");
    let straight = Path::waypoints(problem.kinematics(), control).expect("a path");
    assert_eq!(straight.segments(), 3);
    assert_eq!(prove(&problem, &straight, &FIRST).verdict, MotionVerdict::Free);
    let through = Path::waypoints(problem.kinematics(), vec![0.0, 0.0, 0.0, 0.0, 1.2, 0.0, 0.0, 3.0, 0.0]);
    let found = prove(&problem, &through.expect("a path"), &FIRST);
    assert!(found.verdict == MotionVerdict::Contact && found.alpha > 0.5 && found.alpha < 0.75, "{}", found.alpha);
}

#[test]
fn certificates_of_smooth_links_are_as_close_as_the_solver() {
    // A body whose table is some hundredths too large, 10 µm from what it must not touch.
    let turn = UnitQuaternion::from_euler_angles(0.4, 0.7, -0.2);
    let body = Body::superellipsoid("q6", Vector3::zeros(), Vector3::new(0.3, 0.2, 0.1), 6).expect("a body");
    let body = body.moved(&turn, &Vector3::zeros()).expect("a body");
    let (down, out) = (-Vector3::z(), Vector3::x());
    let lowest = body.support(&down).point.z;
    let farthest = body.support(&out).point;
    let near = 1e-5;
    let ground = HalfSpace::new(Vector3::z(), lowest - near).expect("a half-space");
    let ground = MotionObstacle { name: "ground".into(), placed: PlacedObstacle::HalfSpace(ground, 0.0) };
    // The hand is 2 m out; a capsule along z stands in front of its foremost point.
    let post = MotionShape::Capsule(Capsule::new(0.1, 0.3).expect("a capsule"));
    let at_post = at(2.0 + farthest.x + 0.1 + near, farthest.y, farthest.z);
    // A ball that is deeper in than the margin allows by 10 µm less.
    let inside = at(2.0 + farthest.x + 0.1 - 0.05 + near, farthest.y, farthest.z);
    for (name, obstacle, margin) in [
        ("ground", ground, 0.0),
        ("post", still("post", post, at_post), 0.0),
        ("ball", still("ball", ball(0.1), inside), -0.05),
    ] {
        let problem = problem(hand(solid(body.clone())), vec![obstacle], margin);
        let path = edge(&problem, &[0.0; 3], &[0.0; 3]);
        assert_eq!(prove(&problem, &path, &FIRST).verdict, MotionVerdict::Free, "{name}");
        let found = prove(&problem, &path, &MotionOptions { certificate: true, ..FIRST });
        assert_eq!(found.verdict, MotionVerdict::Free, "{name}");
        let verified = found.certificate.expect("a certificate").verify().expect("a proof");
        let spare = verified.clearance_lower_m - margin;
        assert!(spare > 0.0 && spare <= near + 1e-9, "{name}: {spare}");
    }
}

/// A random robot with bodies of all kinds among obstacles of all kinds.
fn random_problem(seeded: &mut Seeded, margin_m: f64) -> MotionProblem {
    let kinematics = Arc::new(Kinematics::new(&tree(seeded, 6)).expect("a tree"));
    let size = |seeded: &mut Seeded| Vector3::from_fn(|_, _| seeded.between(0.05, 0.4));
    let shape = |seeded: &mut Seeded| match seeded.index(5) {
        0 => MotionShape::Capsule(Capsule::new(0.1, 0.2).expect("a capsule")),
        1 => solid(Body::cuboid("box", size(seeded)).expect("a box")),
        2 => solid(Body::cylinder("cylinder", 0.1, 0.3).expect("a cylinder")),
        3 => {
            let parts = [-0.2, 0.2].map(|x| Body::superellipsoid("q", Vector3::new(x, 0.0, 0.0), size(seeded), 4));
            let parts = parts.into_iter().map(|part| part.expect("a body")).collect();
            let compound = Compound::new("two", parts).expect("a compound");
            MotionShape::Solid(Arc::new(Shape::Compound(Box::new(compound))))
        }
        _ => solid(Body::superellipsoid("q6", Vector3::zeros(), size(seeded), 6).expect("a body")),
    };
    let bodies = (1..6).map(|link| MotionBody {
        name: format!("body{link}").into(),
        link,
        place: seeded.pose(0.2),
        shape: shape(seeded),
    });
    let bodies = bodies.collect();
    let mut obstacles: Vec<_> =
        (0..4).map(|k| still(&format!("obstacle{k}"), shape(seeded), seeded.pose(2.0))).collect();
    let (from, to) = (seeded.pose(4.0), seeded.pose(4.0));
    let moving = PlacedObstacle::Moving { shape: shape(seeded), from, to, place: Pose::identity() };
    obstacles.push(MotionObstacle { name: "moving".into(), placed: moving });
    let carried = PlacedObstacle::Moving { shape: shape(seeded), from, to, place: seeded.pose(0.5) };
    obstacles.push(MotionObstacle { name: "carried".into(), placed: carried });
    let ground = HalfSpace::new(seeded.unit(), -5.0).expect("a half-space");
    obstacles.push(MotionObstacle { name: "ground".into(), placed: PlacedObstacle::HalfSpace(ground, 0.0) });
    let robot = MotionRobot { kinematics, base: seeded.pose(1.0), bodies };
    MotionProblem::new(robot, obstacles, margin_m, |a, b| match (a, b) {
        (MotionItem::Body(a), MotionItem::Body(b)) => (a + 1 < b).then_some(0.01),
        _ => Some(0.0),
    })
    .expect("a problem")
}

/// A random motion of it, of a size in the values.
fn random_path(seeded: &mut Seeded, problem: &MotionProblem, size: f64) -> Path {
    let kinematics = problem.kinematics();
    let from = configuration(seeded, kinematics);
    let mut to: Vec<f64> = from.iter().map(|value| value + size * seeded.signed()).collect();
    for variable in kinematics.variables().iter().filter(|variable| variable.limits.is_some()) {
        to[variable.first] = to[variable.first].clamp(-2.0, 2.0);
    }
    for variable in kinematics.variables().iter().filter(|variable| variable.kind == JointKind::Floating) {
        let own = &mut to[variable.first + 3..variable.first + 7];
        let length = own.iter().map(|x| x * x).sum::<f64>().sqrt();
        own.iter_mut().for_each(|x| *x /= length);
    }
    edge(problem, &from, &to)
}

/// Least signed distance less padding over samples of a path, by the solver alone; of overlaps
/// that count only as such 0.
fn sampled(problem: &MotionProblem, path: &Path, from: f64, to: f64, samples: u32) -> f64 {
    let (mut placing, mut least) = (Placing::default(), f64::INFINITY);
    for sample in 0..=samples {
        let s = from + (to - from) * f64::from(sample) / f64::from(samples);
        // A path that stands still at s, but for what moves by itself.
        let values = path.at(problem.kinematics(), s);
        let here = edge(problem, &values, &values);
        placing.set_at(problem, &here, s);
        for pair in &problem.pairs {
            let placed = placing.pair(problem, pair).expect("poses");
            let [a, b] = pair.pieces.map(|piece| problem.piece(piece).1);
            let (a, b) = ((&a, &placed[0].pose), (&b, &placed[1].pose));
            let found = solve(a, b, pair.threshold_m < 0.0, &Options::default(), &mut WarmStart::default());
            least = least.min(found.upper - pair.padding_m);
        }
    }
    least
}

#[test]
fn what_is_proven_free_is_free_at_samples() {
    let mut verdicts = [0; 3];
    for seed in 0..40 {
        let mut seeded = Seeded(seed);
        let margin = [0.0, 0.02, -0.02][seeded.index(3)];
        let problem = random_problem(&mut seeded, margin);
        let size = seeded.between(0.01, 2.0);
        let path = random_path(&mut seeded, &problem, size);
        let options = MotionOptions { first_contact: seed % 2 == 0, certificate: true, ..MotionOptions::default() };
        let found = prove(&problem, &path, &options);
        verdicts[found.verdict as usize] += 1;
        let (end, name) = (found.alpha, format!("seed {seed}, {:?}", found.verdict));
        if end > 0.0 {
            let least = sampled(&problem, &path, 0.0, end, 30);
            assert!(least >= margin - 1e-12, "{name}: {least} up to {end}");
            assert!(
                found.verdict != MotionVerdict::Free || least >= found.clearance_lower_m - 1e-12,
                "{name}: {least}"
            );
        }
        if let (MotionVerdict::Contact, Some(contact)) = (found.verdict, &found.contact) {
            let there = sampled(&problem, &path, contact.s, contact.s, 1);
            assert!(there < margin + 1e-9 && contact.s >= end, "{name}: {there}");
        }
        // Warm starts change nothing that is proven.
        let mut workspace = MotionWorkspace::default();
        problem.prove(&path, &options, &mut workspace);
        assert_eq!(problem.prove(&path, &options, &mut workspace).verdict, found.verdict, "{name}");
        assert_eq!(found.certificate.is_some(), found.verdict == MotionVerdict::Free, "{name}");
        if let Some(certificate) = found.certificate {
            let text = certificate.to_json();
            let read = Certificate::from_json(&text).expect("a certificate");
            let verified = read.verify().unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(read.verify_against(&problem), Ok(verified), "{name}");
            assert!(verified.clearance_lower_m > margin, "{name}");
        }
    }
    assert!(verdicts[0] > 10 && verdicts[1] > 5 && verdicts[2] < 3, "{verdicts:?}");
}

#[test]
fn searches_end_when_they_have_to() {
    let problem = problem(hand(ball(0.1)), vec![still("post", ball(0.2), at(0.0, 2.31, 0.0))], 0.0);
    let path = edge(&problem, &[0.0, 0.0, 0.0], &[0.0, 3.0, 0.0]);
    let all = prove(&problem, &path, &FIRST);
    assert!(all.verdict == MotionVerdict::Free && all.configurations > 5 && !all.ended_early);
    for most in 0..all.configurations {
        let found = prove(&problem, &path, &MotionOptions { max_configurations: most, ..FIRST });
        assert!(found.ended_early && found.verdict == MotionVerdict::Undecided && found.alpha < 1.0, "{most}");
        assert_eq!(found.configurations, most);
    }
    let stop = AtomicBool::new(true);
    let found = prove(&problem, &path, &MotionOptions { stop: Some(&stop), ..FIRST });
    assert!(found.ended_early && found.alpha == 0.0 && found.configurations == 0);
    // It passes at 1 cm; what moves less than a metre is not looked at again.
    let found = prove(&problem, &path, &MotionOptions { resolution_m: 1.0, ..FIRST });
    assert!(found.verdict == MotionVerdict::Undecided && !found.ended_early, "{found:?}");
    assert!(found.contact.is_some_and(|open| open.lower_m > 0.0 && open.s > 0.2 && open.s < 0.8));
}

#[test]
fn certificates_that_grow_too_long_end_the_search() {
    // The hand goes round a ball at the origin. At 0.4 µm from the clearance that is known a ball
    // of 0.1 m may turn by 4 µrad at most: half a million intervals in 3 rad.
    let problem = problem(hand(ball(0.1)), vec![still("post", ball(0.2), Pose::identity())], 0.0);
    let path = edge(&problem, &[0.0, 0.0, 0.0], &[0.0, 3.0, 0.0]);
    let precise = MotionOptions { clearance_accuracy_m: Some(4e-7), max_configurations: 1 << 24, ..FIRST };
    let free = prove(&problem, &path, &precise);
    assert!(free.verdict == MotionVerdict::Free && !free.ended_early, "{free:?}");
    assert!(free.configurations > 1 << 19, "{}", free.configurations);
    let found = prove(&problem, &path, &MotionOptions { certificate: true, ..precise });
    assert!(found.ended_early && found.verdict == MotionVerdict::Undecided && found.certificate.is_none());
}

#[test]
fn too_many_pairs_are_refused_before_they_are_listed() {
    let part = |index: i32| Body::ball("part", Vector3::x() * 0.3 * f64::from(index), 0.1).expect("a ball");
    let row = Compound::new("row", (0..16).map(part).collect()).expect("a compound");
    let row = MotionShape::Solid(Arc::new(Shape::Compound(Box::new(row))));
    let bodies = |count: usize| {
        let body = |index: usize| MotionBody {
            name: format!("{index}").into(),
            link: 3,
            place: Pose::identity(),
            shape: row.clone(),
        };
        (0..count).map(body).collect::<Vec<_>>()
    };
    // Two bodies make 256 pairs of pieces: one pair of bodies more than are taken.
    let most = MAX_PIECE_PAIRS / 256;
    let mut asked = 0;
    let refused = MotionProblem::new(of_arm(bodies(300)), Vec::new(), 0.0, |_, _| {
        asked += 1;
        Some(0.0)
    });
    assert_eq!(refused.map(|_| ()), Err(MotionProblemError::Pairs(256 * (most + 1))));
    assert_eq!(asked, most + 1);
    // Those that may touch do not count.
    let mut counted = 0;
    let taken = MotionProblem::new(of_arm(bodies(300)), Vec::new(), 0.0, |_, _| {
        counted += 1;
        (counted % 4000 == 0).then_some(0.0)
    });
    assert_eq!((counted, taken.map(|problem| problem.pairs.len())), (150 * 299, Ok(256 * 11)));
}

/// What keeps an egg apart from a cylinder that it goes past.
fn past_a_cylinder() -> (MotionProblem, Certificate) {
    let cylinder = solid(Body::cylinder("cylinder", 0.2, 0.5).expect("a cylinder"));
    let egg = solid(Body::superellipsoid("egg", Vector3::zeros(), Vector3::new(0.1, 0.12, 0.08), 4).expect("a body"));
    let problem = problem(hand(egg), vec![still("post", cylinder, at(0.0, 2.35, 0.0))], 0.0);
    let path = edge(&problem, &[0.0, 0.0, 0.0], &[0.0, 3.0, 0.0]);
    let found = prove(&problem, &path, &MotionOptions { certificate: true, ..FIRST });
    (problem, *found.certificate.expect("a certificate"))
}

#[test]
fn a_certificate_with_another_digest_is_not_read() {
    let (_, certificate) = past_a_cylinder();
    let text = certificate.to_json();
    assert!(certificate.verify().is_ok());
    // Cut off, or a byte changed anywhere: the digest does not fit, or it is no JSON.
    assert!(Certificate::from_json(&text[..text.len() - 1]).is_err());
    let mut changed_bytes = 0;
    for place in (0..text.len()).step_by(7) {
        let mut bytes = text.clone().into_bytes();
        bytes[place] = if bytes[place] == b'1' { b'2' } else { b'1' };
        if let Ok(text) = String::from_utf8(bytes)
            && let Ok(read) = Certificate::from_json(&text)
        {
            panic!("byte {place} was changed and read: {}", read.digest);
        }
        changed_bytes += 1;
    }
    assert!(changed_bytes > 500);
}

/// Whether places of a document are of the proofs of bodies, which take long to check again, or
/// only others.
#[derive(Clone, Copy, PartialEq)]
enum Places {
    Solids,
    Others,
}

/// A document with one place changed, and what was done there.
type Changed = (String, Value);

/// The document with every change of every place: numbers, strings and truth values replaced by
/// each of several others, nulls by what could stand there, everything by null, entries and fields
/// left out, entries repeated, and a field more.
fn changes(document: &Value, places: Places) -> Vec<Changed> {
    let (mut open, mut found) = (vec![String::new()], Vec::new());
    while let Some(place) = open.pop() {
        let here = document.pointer(&place).expect("a place");
        let mut add = |what: String, value: Value| {
            let mut changed = document.clone();
            *changed.pointer_mut(&place).expect("a place") = value;
            found.push((format!("{place}: {what}"), changed));
        };
        for value in replacements(here) {
            add(format!("{value}"), value);
        }
        match here {
            Value::Array(items) => {
                for index in 0..items.len() {
                    let mut less = items.clone();
                    let item = less.remove(index);
                    add(format!("without {index}"), less.into());
                    let mut more = items.clone();
                    more.insert(index, item);
                    add(format!("{index} twice"), more.into());
                    open.push(format!("{place}/{index}"));
                }
            }
            Value::Object(fields) => {
                for name in fields.keys() {
                    let mut less = fields.clone();
                    less.remove(name);
                    add(format!("without {name}"), less.into());
                    let inside = format!("{place}/{name}");
                    if places == Places::Solids || inside != "/claim/solids" {
                        open.push(inside);
                    }
                }
                let mut more = fields.clone();
                more.insert("more".to_owned(), 0.into());
                add("with a field more".to_owned(), more.into());
            }
            _ => {}
        }
    }
    found.retain(|(what, _)| what.starts_with("/claim/solids/") == (places == Places::Solids));
    found
}

/// Other values for a place.
fn replacements(here: &Value) -> Vec<Value> {
    let mut others = match here {
        Value::Number(number) => {
            let number = number.as_f64().expect("a number");
            let whole = |value: f64| number.fract() == 0.0 && value.fract() == 0.0 && value >= 0.0;
            let values = [number + 0.25, number + 1.0, number * 1.001, -number, 0.0, 1e9];
            let value = |value: f64| if whole(value) { Value::from(value as u64) } else { Value::from(value) };
            values.into_iter().filter(|value| *value != number).map(value).collect()
        }
        Value::String(_) => {
            let words = ["", "other", "fixed", "revolute", "continuous", "prismatic", "planar", "balls", "planes"];
            words.into_iter().map(Value::from).collect()
        }
        Value::Bool(truth) => vec![Value::from(!truth)],
        // Limits, a joint that is followed, a support point.
        Value::Null => vec![
            serde_json::json!([-1.0, 1.0]),
            serde_json::json!([0, 0.5, 0.0]),
            serde_json::json!({"point": [0.0, 0.0, 0.0], "multipliers": []}),
        ],
        _ => Vec::new(),
    };
    others.push(Value::Null);
    others.retain(|other| other != here);
    others
}

/// What became of the changes of a certificate.
#[derive(Debug, Default)]
struct Tally {
    unread: u32,
    refused: u32,
    kept: u32,
}

/// Reads every change of a certificate with a digest that fits, and checks that it is refused, or
/// that what it claims is true: at samples of its path, by the solver alone.
fn tally(certificate: &Certificate, problem: &MotionProblem, places: Places) -> Tally {
    let shapes = problem.bodies().iter().map(|body| &body.shape);
    let shapes = shapes.chain(problem.obstacles().iter().filter_map(|obstacle| match &obstacle.placed {
        PlacedObstacle::Still(shape, _) | PlacedObstacle::Moving { shape, .. } => Some(shape),
        PlacedObstacle::HalfSpace(..) => None,
    }));
    let solids: Vec<_> = shapes
        .filter_map(|shape| match shape {
            MotionShape::Solid(solid) => Some(solid.clone()),
            MotionShape::Capsule(_) => None,
        })
        .collect();
    let known = |id: &str| solids.iter().find(|solid| solid.id().to_string() == id).cloned();
    let options = VerifyOptions { known: Some(&known), stop: None };
    let original: Value = serde_json::from_str(&certificate.to_json()).expect("JSON");
    let mut tally = Tally::default();
    for (what, changed) in changes(&original, places) {
        let Ok(mut read) = serde_json::from_value::<Certificate>(changed) else {
            tally.unread += 1;
            continue;
        };
        read.digest = read.computed_digest();
        let Ok(read) = Certificate::from_json(&read.to_json()) else {
            tally.unread += 1;
            continue;
        };
        match read.verify_with(&options) {
            Err(_) => tally.refused += 1,
            Ok(verified) => {
                let problem = read.claim.problem(&options, usize::MAX).expect("a problem");
                let least = sampled(&problem, &read.path, 0.0, 1.0, 16);
                assert!(
                    least > read.margin_m() - 1e-12 && least >= verified.clearance_lower_m - 1e-12,
                    "{what}: {least}, {verified:?}"
                );
                tally.kept += 1;
            }
        }
    }
    println!("{tally:?}");
    tally
}

#[test]
fn a_changed_certificate_is_refused_or_what_it_claims_is_true() {
    let (problem, certificate) = past_a_cylinder();
    let of = tally(&certificate, &problem, Places::Others);
    assert!(of.unread > 300 && of.refused > 300 && of.kept > 50, "{of:?}");
    // A record less.
    let mut less = certificate.clone();
    less.records.pop();
    less.digest = less.computed_digest();
    assert!(matches!(less.verify(), Err(CertificateError::Gap { segment: 0, .. })));
}

#[test]
fn changed_support_points_prove_no_more_than_is_true() {
    // 10 µm from a ball, where only a support point of the body proves that it is not nearer.
    let turn = UnitQuaternion::from_euler_angles(0.4, 0.7, -0.2);
    let body = Body::superellipsoid("q6", Vector3::zeros(), Vector3::new(0.3, 0.2, 0.1), 6).expect("a body");
    let body = body.moved(&turn, &Vector3::zeros()).expect("a body");
    let farthest = body.support(&Vector3::x()).point;
    let beside = at(2.0 + farthest.x + 0.1 + 1e-5, farthest.y, farthest.z);
    let problem = problem(hand(solid(body)), vec![still("ball", ball(0.1), beside)], 0.0);
    let path = edge(&problem, &[0.0; 3], &[1e-7, 0.0, 0.0]);
    let found = prove(&problem, &path, &MotionOptions { certificate: true, ..FIRST });
    let certificate = found.certificate.expect("a certificate");
    assert!(certificate.to_json().contains("tangents") && certificate.verify().is_ok());
    let of = tally(&certificate, &problem, Places::Others);
    assert!(of.unread > 200 && of.refused > 200 && of.kept > 20, "{of:?}");
}

#[test]
fn a_certificate_with_changed_bodies_is_refused_or_what_it_claims_is_true() {
    let (problem, certificate) = past_a_cylinder();
    let of = tally(&certificate, &problem, Places::Solids);
    assert!(of.refused > 1000 && of.unread == 0, "{of:?}");
}

/// The arm with a flap at its end that follows the elbow, two eggs on the hand, a capsule on the
/// flap; among all kinds of obstacles, with allowed pairs and paddings.
fn of_all_kinds() -> MotionProblem {
    let description = arm().description().clone();
    let (mut links, mut joints) = (description.links, description.joints);
    links.push(Link { name: "flap".into(), collisions: Vec::new() });
    joints.push(Joint {
        name: "flap".into(),
        kind: JointKind::Revolute,
        parent: 3,
        child: 4,
        origin: Isometry3::translation(1.0, 0.0, 0.0),
        axis: Vector3::y_axis(),
        limits: Some(Limits { lower: -2.0, upper: 2.0 }),
        mimic: Some(Mimic { joint: 2, multiplier: -0.5, offset: 0.1 }),
    });
    let kinematics = Arc::new(Kinematics::new(&Description { links, joints, ..description }).expect("a tree"));
    let eggs = [-0.1, 0.15].map(|x| Body::superellipsoid("egg", Vector3::x() * x, Vector3::new(0.1, 0.08, 0.05), 4));
    let eggs = Compound::new("eggs", eggs.map(|egg| egg.expect("a body")).into()).expect("a compound");
    let eggs = MotionShape::Solid(Arc::new(Shape::Compound(Box::new(eggs))));
    let capsule = MotionShape::Capsule(Capsule::new(0.04, 0.1).expect("a capsule"));
    let cuboid = solid(Body::cuboid("box", Vector3::new(0.1, 0.1, 0.3)).expect("a box"));
    let body = |name: &str, link, x, shape: &MotionShape| MotionBody {
        name: name.into(),
        link,
        place: at(x, 0.0, 0.0),
        shape: shape.clone(),
    };
    let bodies = vec![body("mast", 1, 0.0, &cuboid), body("hand", 3, 0.7, &eggs), body("flap", 4, 0.15, &capsule)];
    let moving = |name: &str, shape: &MotionShape, from: Pose, to: Pose, place: Pose| MotionObstacle {
        name: name.into(),
        placed: PlacedObstacle::Moving { shape: shape.clone(), from, to, place },
    };
    let ground = HalfSpace::new(Vector3::z(), -1.2).expect("a half-space");
    let obstacles = vec![
        still("post", cuboid.clone(), at(0.0, 2.6, 0.0)),
        moving("cart", &ball(0.2), at(3.0, -1.0, 0.0), at(3.0, 1.5, 0.2), Pose::identity()),
        moving("load", &capsule, at(3.0, -1.0, 0.0), at(3.0, 1.5, 0.2), at(0.0, 0.0, 0.4)),
        MotionObstacle { name: "ground".into(), placed: PlacedObstacle::HalfSpace(ground, 1e-9) },
    ];
    let robot = MotionRobot { kinematics, base: at(0.0, 0.0, 0.1), bodies };
    MotionProblem::new(robot, obstacles, 0.01, |a, b| match (a, b) {
        (MotionItem::Body(1), MotionItem::Body(2)) | (MotionItem::Body(0), MotionItem::Obstacle(3)) => None,
        (MotionItem::Body(1), MotionItem::Obstacle(0)) => Some(0.02),
        (MotionItem::Body(2), MotionItem::Obstacle(_)) => Some(-0.005),
        _ => Some(0.0),
    })
    .expect("a problem")
}

#[test]
fn changed_certificates_with_all_that_can_be_claimed() {
    let problem = of_all_kinds();
    let around = vec![0.0, 0.0, 0.2, 0.3, 1.0, 1.2, 0.0, 2.0, -0.3];
    for path in [
        Path::waypoints(problem.kinematics(), around.clone()).expect("a path"),
        Path::bezier(problem.kinematics(), around).expect("a path"),
    ] {
        let found = prove(&problem, &path, &MotionOptions { certificate: true, ..FIRST });
        assert_eq!(found.verdict, MotionVerdict::Free, "{:?}", found.contact);
        let certificate = found.certificate.expect("a certificate");
        let verified = certificate.verify().expect("a proof");
        assert!(verified.pairs > 15 && sampled(&problem, &path, 0.0, 1.0, 100) >= verified.clearance_lower_m);
        println!("{} records, {} bytes", certificate.records(), certificate.to_json().len());
        let of = tally(&certificate, &problem, Places::Others);
        assert!(of.unread > 1000 && of.refused > 1000 && of.kept > 100, "{of:?}");
    }
}

#[test]
fn a_certificate_of_something_else_says_what_differs() {
    let problem = of_all_kinds();
    let path = edge(&problem, &[0.0, 0.0, 0.2], &[0.1, 0.2, 0.0]);
    let found = prove(&problem, &path, &MotionOptions { certificate: true, ..FIRST });
    let certificate = found.certificate.expect("a certificate");
    assert!(certificate.verify_against(&problem).is_ok());
    let rules = || problem.rules.clone();
    let robot = || MotionRobot {
        kinematics: problem.kinematics.clone(),
        base: at(0.0, 0.0, 0.1),
        bodies: problem.bodies.clone(),
    };
    let obstacles = || problem.obstacles.clone();
    let other = |robot: MotionRobot, obstacles: Vec<MotionObstacle>, margin_m: f64, rules: Vec<_>| {
        let other = MotionProblem::of_rules(robot, obstacles, margin_m, rules).expect("a problem");
        certificate.verify_against(&other).map(|_| ())
    };
    assert_eq!(other(robot(), obstacles(), 0.01, rules()), Ok(()), "the same made again");
    let differs = |what: &'static str| Err(CertificateError::Other(what));
    // Of the robot: a limit, what is followed and how, an axis, a name.
    let description = problem.kinematics().description();
    let changes: [&dyn Fn(&mut Description); 5] = [
        &|description| description.joints[0].limits = Some(Limits { lower: -4.0, upper: 4.5 }),
        &|description| description.joints[3].mimic = Some(Mimic { joint: 2, multiplier: -0.5, offset: 0.1 + 1e-16 }),
        &|description| description.joints[3].mimic = Some(Mimic { joint: 1, multiplier: -0.5, offset: 0.1 }),
        &|description| description.joints[1].axis = -description.joints[1].axis,
        &|description| description.name = "leg".into(),
    ];
    for change in changes {
        let mut changed = description.clone();
        change(&mut changed);
        let kinematics = Arc::new(Kinematics::new(&changed).expect("a tree"));
        let found = other(MotionRobot { kinematics, ..robot() }, obstacles(), 0.01, rules());
        assert_eq!(found, differs("robot"), "{changed:?}");
    }
    let moved = MotionRobot { base: at(0.0, 1e-12, 0.1), ..robot() };
    assert_eq!(other(moved, obstacles(), 0.01, rules()), differs("base pose"));
    let bodies = |change: &dyn Fn(&mut Vec<MotionBody>)| {
        let mut bodies = problem.bodies.clone();
        change(&mut bodies);
        other(MotionRobot { bodies, ..robot() }, obstacles(), 0.01, rules())
    };
    assert_eq!(bodies(&|bodies| bodies[1].place = at(0.7, 1e-12, 0.0)), differs("set of bodies"));
    assert_eq!(bodies(&|bodies| bodies[2].link = 3), differs("set of bodies"));
    assert_eq!(bodies(&|bodies| bodies[2].shape = ball(0.04)), differs("set of bodies"));
    let among = |change: &dyn Fn(&mut Vec<MotionObstacle>)| {
        let mut obstacles = problem.obstacles.clone();
        change(&mut obstacles);
        let count = obstacles.len();
        let is_there = |item: &MotionItem| !matches!(item, MotionItem::Obstacle(index) if *index >= count);
        let rules = rules().into_iter().filter(|(_, b, _)| is_there(b)).collect();
        other(robot(), obstacles, 0.01, rules)
    };
    let moving = |z: f64| PlacedObstacle::Moving {
        shape: ball(0.2),
        from: at(3.0, -1.0, 0.0),
        to: at(3.0, 1.5, z),
        place: Pose::identity(),
    };
    assert_eq!(among(&|obstacles| obstacles[1].placed = moving(0.2)), Ok(()), "the same body made again");
    assert_eq!(among(&|obstacles| obstacles[1].placed = moving(0.3)), differs("set of obstacles"));
    assert_eq!(among(&|obstacles| obstacles[0].name = "pillar".into()), differs("set of obstacles"));
    assert_eq!(among(&|obstacles| obstacles.truncate(3)), differs("set of obstacles"));
    assert_eq!(among(&|obstacles| obstacles.swap(1, 2)), differs("set of obstacles"));
    assert_eq!(other(robot(), obstacles(), 0.02, rules()), differs("margin or padding"));
    let mut padded = rules();
    padded[0].2 = 1e-9;
    assert_eq!(other(robot(), obstacles(), 0.01, padded), differs("margin or padding"));
    // Fewer pairs that count, and more.
    assert_eq!(other(robot(), obstacles(), 0.01, rules()[1..].to_vec()), differs("set of allowed pairs"));
    let more = MotionProblem::new(robot(), obstacles(), 0.01, |a, b| {
        let rule = rules().into_iter().find(|rule| (rule.0, rule.1) == (a, b));
        Some(rule.map_or(0.0, |rule| rule.2))
    });
    let more = certificate.verify_against(&more.expect("a problem"));
    assert_eq!(more, Err(CertificateError::Other("set of allowed pairs")));
}

fn derive(problem: &MotionProblem, items: [MotionItem; 2]) -> DerivedPair {
    problem.derive(items, &DeriveOptions::default(), &mut |_| ControlFlow::Continue(()))
}

#[test]
fn pairs_that_touch_never_always_or_sometimes_are_classified() {
    // On the arm, which slides by 4 m, turns by 4 rad and folds without end: the hand comes as near
    // to the slide's ball as it likes, a ball on the elbow's axis is always 1 m away from it.
    let body = |name: &str, link: usize, x: f64, radius: f64| MotionBody {
        name: name.into(),
        link,
        place: at(x, 0.0, 0.0),
        shape: ball(radius),
    };
    let derived = |a: MotionBody, b: MotionBody, margin_m: f64| {
        let between = body("upper", 2, 0.5, 0.01);
        let problem = problem(vec![a, between, b], Vec::new(), margin_m);
        let items = [MotionItem::Body(0), MotionItem::Body(2)];
        assert!(problem.body_pairs().any(|pair| pair == items));
        (derive(&problem, items), problem)
    };
    let slide = |radius: f64| body("slide", 1, 0.0, radius);
    let (never, _) = derived(slide(0.4), body("elbow", 3, 0.0, 0.55), 0.0);
    assert_eq!((never.class, never.witness), (PairClass::Never, None));
    assert!((never.upper_m - 0.05).abs() < 1e-6, "{}", never.upper_m);
    let (always, _) = derived(slide(0.4), body("elbow", 3, 0.0, 0.65), 0.0);
    assert_eq!(always.class, PairClass::Always);
    let (always, _) = derived(slide(0.4), body("elbow", 3, 0.0, 0.55), 0.1);
    assert_eq!(always.class, PairClass::Always, "nearer than the margin");
    let (collides, problem) = derived(slide(0.2), body("hand", 3, 1.0, 0.1), 0.0);
    assert_eq!(collides.class, PairClass::Collides);
    // Folded, the centres meet: the two balls overlap by both radii, 0.3 m, and depths are bounded
    // to a hundredth.
    assert!(collides.upper_m < -0.297, "{}", collides.upper_m);
    let witness = collides.witness.expect("a configuration");
    problem.kinematics().check(&witness).expect("within the limits");
    let still = edge(&problem, &witness, &witness);
    assert_eq!(prove(&problem, &still, &FIRST).verdict, MotionVerdict::Contact);
    // Neighbours, a pair that does not count, and a search that is stopped.
    let two = self::problem(vec![slide(0.2), body("upper", 2, 0.5, 0.1)], Vec::new(), 0.0);
    let items = [MotionItem::Body(0), MotionItem::Body(1)];
    assert_eq!(derive(&two, items).class, PairClass::Adjacent);
    let bodies = vec![slide(0.2), body("upper", 2, 0.5, 0.1), body("hand", 3, 1.0, 0.1)];
    let none = MotionProblem::new(of_arm(bodies), Vec::new(), 0.0, |_, _| None).expect("a problem");
    let items = [MotionItem::Body(0), MotionItem::Body(2)];
    assert_eq!(derive(&none, items).class, PairClass::Undecided);
    let stopped = problem.derive(items, &DeriveOptions::default(), &mut |_| ControlFlow::Break(()));
    assert_eq!((stopped.class, stopped.boxes), (PairClass::Undecided, 0));
}
