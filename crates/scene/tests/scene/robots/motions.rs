//! Motions of a robot in a scene, against dense samples of its states.

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{HalfSpace, Pose};
use sublevel_robot::motion::{MotionAnswer, MotionVerdict};
use sublevel_scene::query::{
    JointValues, MotionSettings, MovingObject, PathKind, RobotMotionAnswer, RobotMotions, RobotMotionsError,
    StateVerdict, States,
};
use sublevel_scene::{Attachment, Crew, Geometry, NamedHalfSpace, Placement, Question, Scene, Stop, Subject, Update};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::{at, replayed, seeds};

use super::{applied, cell, place, robot_with, set, slot, things, values};
use crate::worlds::placement;

/// What motions and states are asked under.
#[derive(Clone, Default)]
struct Terms {
    margin_m: f64,
    include_allowed: bool,
    /// An object that moves meanwhile, with its poses at the start and at the end.
    moving: Option<(&'static str, [Pose; 2])>,
    settings: MotionSettings,
}

/// A path: configurations, and what they are.
type Way = (Vec<[f64; 4]>, PathKind);

fn question(scene: &Scene, terms: &Terms, ways: &[Way]) -> RobotMotions {
    let moving = terms.moving.map(|(name, [from, to])| MovingObject { slot: slot(scene, name), from, to });
    let moving: Vec<_> = moving.into_iter().collect();
    let motions = RobotMotions::new(scene.clone(), "arm", &moving, terms.margin_m, terms.include_allowed);
    let packed: Vec<f64> = ways.iter().flat_map(|(points, _)| points.as_flattened()).copied().collect();
    let points: Vec<usize> = ways.iter().map(|(points, _)| points.len()).collect();
    let motions = motions.expect("motions").with_joint_paths(&[], &packed, &points, ways[0].1);
    motions.expect("paths").with_settings(terms.settings)
}

fn ask(threads: usize, question: RobotMotions) -> Vec<RobotMotionAnswer> {
    Crew::new(threads).expect("threads").ask(Arc::new(question), Arc::default()).expect("answered")
}

/// What is known of one path.
fn checked(scene: &Scene, terms: &Terms, way: &Way) -> MotionAnswer {
    match &ask(1, question(scene, terms, std::slice::from_ref(way)))[..] {
        [RobotMotionAnswer::Checked(answer)] => (**answer).clone(),
        other => panic!("{other:?}"),
    }
}

/// The configuration of a path at s, by its definition.
fn along((points, kind): &Way, s: f64) -> [f64; 4] {
    let between = |a: &[f64; 4], b: &[f64; 4], t: f64| std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t);
    match kind {
        PathKind::Waypoints => {
            let scaled = s * (points.len() - 1) as f64;
            let first = (scaled as usize).min(points.len() - 2);
            between(&points[first], &points[first + 1], scaled - first as f64)
        }
        PathKind::Bezier => {
            let mut row = points.clone();
            while row.len() > 1 {
                row = row.windows(2).map(|pair| between(&pair[0], &pair[1], s)).collect();
            }
            row[0]
        }
    }
}

/// Where an object is at s that goes from one pose to another.
fn moved([from, to]: &[Pose; 2], s: f64) -> Pose {
    let shift = to.translation() - from.translation();
    let turn = (to.rotation() * from.rotation().inverse()).scaled_axis();
    let rotation = UnitQuaternion::from_scaled_axis(turn * s) * from.rotation();
    sublevel_testkit::random::pose(from.translation() + shift * s, &rotation)
}

/// What the states of a path are at some of its parameters, one by one.
fn sampled(scene: &Scene, terms: &Terms, way: &Way, places: &[f64]) -> Vec<StateVerdict> {
    let of = |scene: Scene, values: Vec<f64>| {
        let joints = JointValues { robot: "arm", joints: &[], values };
        let states = States::of_joints(scene, joints, terms.margin_m, terms.include_allowed).expect("states");
        let answers = (0..states.chunks()).flat_map(|chunk| states.solve(chunk, &Stop::default()));
        answers.map(|answer| answer.verdict).collect::<Vec<_>>()
    };
    let Some((name, poses)) = &terms.moving else {
        return of(scene.clone(), places.iter().flat_map(|&s| along(way, s)).collect());
    };
    let at_place = |&s: &f64| {
        let there = scene.posed(&[(slot(scene, name), moved(poses, s))]).expect("poses");
        of(there, along(way, s).to_vec())
    };
    places.iter().flat_map(at_place).collect()
}

/// States of a path that are looked at. More take longer than a test may, fewer see less of what is
/// in contact for a short while.
const SAMPLES: u32 = 600;

/// Checks an answer against samples: free is free everywhere, a contact is one where it was seen,
/// and before the part that is proven free ends there is none.
fn agrees(name: &str, scene: &Scene, terms: &Terms, way: &Way) -> MotionVerdict {
    let answer = checked(scene, terms, way);
    let places: Vec<f64> = (0..=SAMPLES).map(|sample| f64::from(sample) / f64::from(SAMPLES)).collect();
    let states = sampled(scene, terms, way, &places);
    for (s, state) in places.iter().zip(&states) {
        let is_proven = answer.alpha > 0.0 && *s <= answer.alpha;
        assert!(!is_proven || *state == StateVerdict::Free, "{name}: {state:?} at {s}, {answer:?}");
    }
    match answer.verdict {
        MotionVerdict::Free => assert!(answer.alpha == 1.0 && answer.contact.is_none(), "{name}: {answer:?}"),
        MotionVerdict::Contact => {
            let seen = answer.contact.as_ref().expect("a contact").s;
            assert!(answer.alpha <= seen, "{name}: {answer:?}");
            let found = sampled(scene, terms, way, &[seen]);
            assert_eq!(found, [StateVerdict::Contact], "{name}: {answer:?}");
            if terms.settings.first_contact {
                // What is proven ends where some pair is all but in contact: nearer by what two of
                // the shortest pieces of the path move it.
                let near = Terms { margin_m: terms.margin_m + 3.0 * terms.settings.resolution_m, ..terms.clone() };
                let found = sampled(scene, &near, way, &[answer.alpha]);
                assert_eq!(found, [StateVerdict::Contact], "{name}: {answer:?}");
            }
        }
        MotionVerdict::Undecided => panic!("{name}: {answer:?}"),
    }
    if states.contains(&StateVerdict::Contact) {
        assert_eq!(answer.verdict, MotionVerdict::Contact, "{name}");
    }
    answer.verdict
}

/// The arm with a tool among a few boxes and balls, one of which hangs on another.
fn clutter(random: &mut Seeded) -> Scene {
    let mut update = Update::default();
    for index in 0..5 {
        let shift = Vector3::new(1.0, 0.0, 0.5) + random.unit() * (0.7 + 0.6 * random.positive());
        let place = sublevel_testkit::random::pose(shift, &random.rotation());
        update.upserts.push(placement(&format!("o{index}"), &things()[index % 2], place));
    }
    let hangs = Attachment { to: "o0".into(), pose: at(0.0, 0.0, -0.3), touch: Vec::new() };
    let load = placement("load", &things()[1], at(0.0, 0.0, 0.0));
    update.upserts.push(Placement { pose: None, attachment: Some(hangs), ..load });
    applied(&cell(&[]), &update)
}

fn configuration(random: &mut Seeded) -> [f64; 4] {
    [1.5 * random.signed(), 1.5 * random.signed(), 3.0 * random.signed(), 0.05 * random.positive()]
}

/// A path of two to four configurations near one another.
fn way(random: &mut Seeded, kind: PathKind) -> Way {
    let first = configuration(random);
    let limits = [(-2.5, 2.5), (-3.0, 3.0), (-9.0, 9.0), (0.0, 0.05)];
    let size = random.between(0.1, 1.0);
    let more = (0..1 + random.index(3)).map(|_| {
        let near = |k: usize| first[k] + size * random.signed() * if k == 3 { 0.05 } else { 1.0 };
        let values = [0, 1, 2, 3].map(near);
        std::array::from_fn(|k| values[k].clamp(limits[k].0, limits[k].1))
    });
    (std::iter::once(first).chain(more.collect::<Vec<_>>()).collect(), kind)
}

/// What can be changed of a scene and its terms, one at a time.
const CASES: [&str; 7] = ["plain", "padding", "margin", "allowed", "allowed pairs counted", "moving", "carried"];

#[test]
fn motions_are_what_their_states_are() {
    let group = || Subject::Group("arm".into());
    // With so small a fore arm and wrist neighbours do not always touch one another.
    let small = Body::cuboid("small", Vector3::new(0.02, 0.02, 0.03)).expect("a box").with_gap(0.0);
    let small = robot_with(&[], &["fore", "wrist"].map(|link| (link.into(), small.clone().into())).into());
    let mut tally = [[0; 2]; CASES.len()];
    let seeds = seeds(0, 140, &[]);
    println!("seeds {:?} to {:?}, 4 paths of {SAMPLES} samples each", seeds.first(), seeds.last());
    for seed in seeds {
        let mut random = Seeded(seed);
        let case = seed as usize % CASES.len();
        let mut scene = clutter(&mut random);
        let settings = MotionSettings { first_contact: seed % 2 == 0, ..MotionSettings::default() };
        let mut terms = Terms { settings, ..Terms::default() };
        let mut more = Update::default();
        match CASES[case] {
            "padding" => more.group_paddings = vec![("arm".into(), Some(0.05))],
            "margin" => terms.margin_m = 0.03,
            "allowed" => {
                more.allow = vec![(group(), Subject::Object("o0".into())), (group(), Subject::Object("tool".into()))];
            }
            "allowed pairs counted" => {
                more.robots = vec![place("arm", &small, at(1.0, 0.0, 0.0))];
                more.allow = vec![(group(), Subject::Object("o1".into()))];
                terms.include_allowed = true;
            }
            "moving" | "carried" => {
                // The base of what moves, and what hangs on it.
                let name = if CASES[case] == "moving" { "o1" } else { "o0" };
                let there = || Vector3::new(1.0, 0.0, 0.7);
                let ends = [(); 2].map(|()| {
                    let shift = there() + random.unit() * (0.6 + 0.6 * random.positive());
                    sublevel_testkit::random::pose(shift, &random.rotation())
                });
                terms.moving = Some((name, ends));
            }
            _ => {}
        }
        scene = applied(&scene, &more);
        let kind = if random.index(3) == 0 { PathKind::Bezier } else { PathKind::Waypoints };
        for _ in 0..4 {
            let name = format!("seed {seed}, {}, {kind:?}", CASES[case]);
            let verdict = agrees(&name, &scene, &terms, &way(&mut random, kind));
            tally[case][usize::from(verdict == MotionVerdict::Free)] += 1;
        }
    }
    println!("{tally:?}");
    for (case, [contacts, free]) in CASES.iter().zip(tally).filter(|_| !replayed()) {
        assert!(contacts > 5 && free > 5, "{case}: {contacts} contacts, {free} free");
    }
}

/// A way of the tool past the ball at 1.2 m height: the tool is 0.35 m beyond the wrist.
fn past(ball_z: f64) -> (Scene, Way) {
    let put = Update { poses: vec![("ball".into(), at(2.0, 0.0, ball_z))], ..Update::default() };
    (applied(&cell(&[]), &put), (vec![[0.0; 4], [1.0, 0.0, 0.0, 0.0]], PathKind::Waypoints))
}

#[test]
fn paddings_rules_and_what_is_held_change_what_motions_are() {
    let group = || Subject::Group("arm".into());
    let object = |name: &str| Subject::Object(name.into());
    let terms = Terms::default();
    let is = |scene: &Scene, terms: &Terms, way: &Way, expected: MotionVerdict, what: &str| {
        assert_eq!(agrees(what, scene, terms, way), expected, "{what}");
    };
    let (free, contact) = (MotionVerdict::Free, MotionVerdict::Contact);
    // At 1 rad the axis of the arm passes 1.25 sin 1 along x and 0.1 + 1.25 cos 1 along z with its
    // tool: the ball is farther away.
    let (scene, way) = past(1.5);
    is(&scene, &terms, &way, free, "far");
    let clearance = checked(
        &scene,
        &Terms { settings: MotionSettings { clearance_accuracy_m: Some(1e-4), ..terms.settings }, ..terms.clone() },
        &way,
    )
    .clearance_lower_m;
    // Links keep less than that from one another: the ball counts when these may touch.
    let alone = Update { allow: vec![(group(), group()), (group(), object("tool"))], ..Update::default() };
    let scene = applied(&scene, &alone);
    let precise =
        Terms { settings: MotionSettings { clearance_accuracy_m: Some(1e-4), ..terms.settings }, ..terms.clone() };
    let of_ball = checked(&scene, &precise, &way).clearance_lower_m;
    assert!(of_ball > clearance && of_ball > 0.1, "{of_ball} {clearance}");
    let near = Terms { margin_m: of_ball + 2e-4, ..terms.clone() };
    is(&scene, &near, &way, contact, "within the margin");
    is(&scene, &Terms { margin_m: of_ball - 1e-6, ..terms.clone() }, &way, free, "just beyond the margin");
    let near_again = |padding: f64, name: &str| {
        let update = match name {
            "group" => Update { group_paddings: vec![("arm".into(), Some(padding))], ..Update::default() },
            name => Update { object_paddings: vec![(name.into(), Some(padding))], ..Update::default() },
        };
        applied(&scene, &update)
    };
    // The tool is nearest, and it is of no group.
    is(&near_again(of_ball + 2e-4, "ball"), &terms, &way, contact, "padding of the ball");
    is(&near_again(of_ball + 2e-4, "tool"), &terms, &way, contact, "padding of the tool");
    is(&near_again(of_ball - 1e-6, "tool"), &terms, &way, free, "less padding of the tool");
    is(&near_again(of_ball + 2e-4, "group"), &terms, &way, free, "padding of the links");
    is(&near_again(2.0, "group"), &terms, &way, contact, "padding of the links that reaches the ball");
    // Down into the ball, unless the two may touch; all pairs count where that is asked for.
    let (scene, way) = past(0.9);
    let scene = applied(&scene, &alone);
    is(&scene, &terms, &way, contact, "in the way");
    let allow = |names: &[&str]| {
        let pairs = names.iter().map(|name| if *name == "arm" { group() } else { object(name) });
        Update { allow: pairs.map(|subject| (subject, object("ball"))).collect(), ..Update::default() }
    };
    let touching = applied(&scene, &allow(&["tool", "arm"]));
    is(&touching, &terms, &way, free, "the ball may be touched");
    let tool = applied(&scene, &allow(&["tool"]));
    let all = Terms { include_allowed: true, ..terms.clone() };
    is(&touching, &all, &way, contact, "neighbours count where all do");
    // Of what is held only the tool reaches the ball.
    is(&tool, &terms, &way, free, "the tool may touch the ball");
    let dropped = applied(&scene, &Update { detach: vec!["tool".into()], ..Update::default() });
    let away = Update { poses: vec![("tool".into(), at(-5.0, 0.0, 0.0))], ..Update::default() };
    is(&applied(&dropped, &away), &terms, &way, free, "the tool is laid down elsewhere");
}

#[test]
fn paths_with_unusable_values_are_invalid_and_no_others() {
    let scene = cell(&[]);
    let (nan, end) = (f64::NAN, [0.5, 0.0, 0.0, 0.01]);
    let still = [0.0; 4];
    let ways: [(&[[f64; 4]], Option<usize>); 8] = [
        (&[still, end], None),
        (&[[nan, 0.0, 0.0, 0.0], end], Some(0)),
        (&[still, end, [0.0, nan, 0.0, 0.0]], Some(2)),
        (&[still, [f64::INFINITY, 0.0, 0.0, 0.0]], Some(1)),
        (&[still, [0.0, 0.0, f64::NEG_INFINITY, 0.0]], Some(1)),
        (&[still, [2.5 + 1e-8, 0.0, 0.0, 0.0], still], Some(1)),
        (&[still, [0.0, 0.0, 0.0, -1e-8]], Some(1)),
        (&[still, [0.0, 0.0, 100.0, 0.05]], None),
    ];
    for kind in [PathKind::Waypoints, PathKind::Bezier] {
        let paths: Vec<Way> = ways.iter().map(|(points, _)| (points.to_vec(), kind)).collect();
        let found = ask(2, question(&scene, &Terms::default(), &paths));
        for ((points, expected), answer) in ways.iter().zip(&found) {
            match (answer, expected) {
                (RobotMotionAnswer::Invalid(point, _), Some(expected)) => assert_eq!(point, expected, "{points:?}"),
                (RobotMotionAnswer::Checked(answer), None) => assert_eq!(answer.verdict, MotionVerdict::Free),
                _ => panic!("{points:?}: {answer:?}"),
            }
        }
    }
}

#[test]
fn questions_end_at_the_first_path_that_is_not_free() {
    let (scene, through) = past(0.9);
    let straight = |to: f64| (vec![[0.0; 4], [to, 0.0, 0.0, 0.0]], PathKind::Waypoints);
    let (free, invalid) = (straight(-0.4), straight(3.0));
    for (ways, expected) in [
        (vec![through.clone(), free.clone(), invalid.clone(), free.clone()], "cnnn"),
        (vec![free.clone(), free.clone(), through.clone(), through.clone(), free.clone()], "ffcnn"),
        (vec![free.clone(), invalid.clone(), through.clone(), free.clone()], "finn"),
        (vec![free.clone(), free.clone()], "ff"),
    ] {
        let kind = |answer: &RobotMotionAnswer| match answer {
            RobotMotionAnswer::Checked(answer) if answer.verdict == MotionVerdict::Free => 'f',
            RobotMotionAnswer::Checked(answer) if answer.verdict == MotionVerdict::Contact => 'c',
            RobotMotionAnswer::Checked(_) => 'u',
            RobotMotionAnswer::Invalid(..) => 'i',
            RobotMotionAnswer::NotChecked => 'n',
        };
        // One thread takes one path after the other.
        let question = || question(&scene, &Terms::default(), &ways);
        let found: String = ask(1, question().stopping_at_first()).iter().map(kind).collect();
        assert_eq!(found, expected);
        let all: String = ask(1, question()).iter().map(kind).collect();
        assert!(!all.contains('n') && all.starts_with(expected.trim_end_matches('n')), "{all}");
    }
}

#[test]
fn motions_that_are_none_are_refused() {
    let scene = cell(&[]);
    let new = |scene: &Scene, robot: &str, moving: &[MovingObject], margin_m: f64| {
        RobotMotions::new(scene.clone(), robot, moving, margin_m, false).map(|_| ())
    };
    let moves = |name: &str| MovingObject { slot: slot(&scene, name), from: at(0.0, 0.0, 9.0), to: at(0.0, 0.0, 8.0) };
    assert_eq!(new(&scene, "arm", &[moves("ball")], 0.0), Ok(()));
    assert_eq!(new(&scene, "leg", &[], 0.0), Err(RobotMotionsError::NoRobot("leg".into())));
    for name in ["tool", "arm/fore"] {
        assert_eq!(new(&scene, "arm", &[moves(name)], 0.0), Err(RobotMotionsError::Held(name.into())));
    }
    let twice = new(&scene, "arm", &[moves("ball"), moves("ball")], 0.0);
    assert_eq!(twice, Err(RobotMotionsError::Twice("ball".into())));
    assert!(matches!(new(&scene, "arm", &[], f64::NAN), Err(RobotMotionsError::Problem(_))));
    let plane = NamedHalfSpace::new("floor", HalfSpace::new(Vector3::z(), -1.0).expect("a plane"));
    let plane = Geometry::HalfSpace(Arc::new(plane.expect("a name")));
    let floor = Update { upserts: vec![placement("floor", &plane, at(0.0, 0.0, 0.0))], ..Update::default() };
    let scene = scene.updated(&floor, |id| (id == plane.id()).then(|| plane.clone())).expect("placed");
    let floor = MovingObject { slot: slot(&scene, "floor"), ..moves("ball") };
    assert_eq!(new(&scene, "arm", &[floor], 0.0), Err(RobotMotionsError::HalfSpace("floor".into())));
    let paths = |joints: &[&str], values: &[f64], points: &[usize], kind: PathKind| {
        let motions = RobotMotions::new(scene.clone(), "arm", &[], 0.0, false).expect("motions");
        let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
        motions.with_joint_paths(&joints, values, points, kind).expect_err("refused").to_string()
    };
    let lines = PathKind::Waypoints;
    assert!(paths(&["knee"], &[0.0; 2], &[2], lines).contains("no joint \"knee\""));
    assert!(paths(&["bend", "bend"], &[0.0; 4], &[2], lines).contains("named twice"));
    assert!(paths(&[], &[0.0; 9], &[2], lines).contains("2 configurations of 4 values take 8"));
    assert!(paths(&["bend"], &[0.0; 3], &[2, 1], lines).contains("path 1 holds 1 configuration;"));
    assert!(paths(&["bend"], &[0.0; 17], &[17], PathKind::Bezier).contains("at most 16"));
}

#[test]
fn joints_that_are_not_named_stay_as_in_the_scene() {
    let (scene, _) = past(0.9);
    let bent = applied(&scene, &set("arm", values(&["bend", "slide"], &[-1.0, 0.03])));
    let named = |scene: &Scene, joints: &[&str], values: &[f64]| {
        let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
        let motions = RobotMotions::new(scene.clone(), "arm", &[], 0.0, false).expect("motions");
        let settings = MotionSettings { first_contact: true, ..MotionSettings::default() };
        let motions = motions.with_joint_paths(&joints, values, &[2], PathKind::Waypoints).expect("a path");
        match &ask(1, motions.with_settings(settings))[..] {
            [RobotMotionAnswer::Checked(answer)] => (answer.verdict, answer.alpha, answer.configurations),
            other => panic!("{other:?}"),
        }
    };
    let straight = named(&scene, &["shoulder"], &[0.0, 1.0]);
    let by_name = named(&bent, &["shoulder"], &[0.0, 1.0]);
    assert_eq!((straight.0, by_name.0), (MotionVerdict::Contact, MotionVerdict::Free));
    assert_eq!(by_name, named(&scene, &[], &[0.0, -1.0, 0.0, 0.03, 1.0, -1.0, 0.0, 0.03]));
    assert_eq!(straight, named(&bent, &["slide", "shoulder", "bend"], &[0.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
}
