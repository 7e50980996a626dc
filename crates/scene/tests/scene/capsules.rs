//! Scenes with capsules: limbs between crates, over a floor, beside a ring.

use std::collections::HashSet;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::{Body, Compound};
use sublevel_core::measure::{Capsule, HalfSpace, Pose};
use sublevel_scene::query::{
    Answer, AnswerStatus, Ask, Clearance, Measure, Operand, Pairs, Rays, Selection, StateVerdict, States, Verdict,
    Within, combined,
};
use sublevel_scene::{Crew, Geometry, NamedCapsule, Scene, Update};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::at;
use sublevel_testkit::sos_bodies::torus;

use crate::worlds::{floor, lookup, placement};

/// Radius and half the length of the axis of the limb, metres.
const LIMB: (f64, f64) = (0.1, 0.5);

/// A limb along z at the origin; around it a crate, an egg, a pair of balls, a lying limb, a ring
/// and a floor 2 m below.
fn room() -> Scene {
    let limb = || NamedCapsule::new("limb", Capsule::new(LIMB.0, LIMB.1).expect("a capsule")).expect("a name");
    let crate_ = Body::cuboid("crate", Vector3::new(0.2, 0.3, 0.4)).expect("a box");
    let egg = Body::superellipsoid("egg", Vector3::zeros(), Vector3::new(0.3, 0.2, 0.2), 4).expect("an egg");
    let ball = |x: f64| Body::ball("ball", Vector3::new(x, 0.0, 0.0), 0.1).expect("a ball");
    let pair = Compound::new("pair", vec![ball(-0.3), ball(0.3)]).expect("a compound");
    let bodies: Vec<Geometry> = vec![limb().into(), crate_.into(), egg.into(), pair.into(), torus(0.2).into(), floor()];
    let lying = UnitQuaternion::from_scaled_axis(Vector3::y() * std::f64::consts::FRAC_PI_2);
    let lying = Pose::from_quaternion(Vector3::new(0.0, 0.0, 1.2), lying.coords.into()).expect("a pose");
    let mut update = Update::default();
    let mut place = |name: &str, body: usize, pose: Pose| update.upserts.push(placement(name, &bodies[body], pose));
    place("limb", 0, at(0.0, 0.0, 0.0));
    place("crate", 1, at(1.0, 0.0, 0.0));
    place("egg", 2, at(-1.0, 0.0, 0.2));
    place("pair", 3, at(0.0, 0.9, 0.0));
    place("lying", 0, lying);
    place("ring", 4, at(0.0, -3.0, 0.0));
    place("floor", 5, at(0.0, 0.0, 0.0));
    Scene::new("room", 0).expect("a name").updated(&update, lookup(&bodies)).expect("an update")
}

fn slot(scene: &Scene, name: &str) -> u32 {
    scene.slot(name).expect("an object")
}

fn answers(scene: &Scene, ask: Ask, operands: Vec<Operand>) -> Vec<Answer> {
    let pairs = (1..operands.len() as u32).map(|other| [0, other]).collect();
    let question = Pairs::new(scene.clone(), ask, operands, pairs).expect("pairs");
    let crew = Crew::new(2).expect("threads");
    crew.ask(Arc::new(question), Arc::default()).expect("answered").concat()
}

#[test]
fn distances_of_capsules_have_closed_forms() {
    let scene = room();
    let object = |name: &str| Operand::Object(slot(&scene, name));
    let wall = HalfSpace::new(-Vector3::x(), -3.0).expect("a half-space");
    let operands = vec![
        object("limb"),
        object("crate"),
        object("egg"),
        object("pair"),
        object("lying"),
        object("floor"),
        Operand::Point(Vector3::new(0.3, 0.4, 0.1)),
        Operand::HalfSpace(wall),
    ];
    let mut ask = Ask::new(vec![Measure::Distance, Measure::Signed, Measure::Overlap]).expect("measures");
    ask.gradients = true;
    let truths = [0.7, 0.6, 0.9_f64.hypot(0.3) - 0.2, 0.5, 1.4, 0.4, 2.9];
    for (found, truth) in answers(&scene, ask, operands).chunks(3).zip(truths) {
        for answer in &found[..2] {
            assert_eq!(answer.status, AnswerStatus::Converged, "{truth}: {answer:?}");
            assert!(answer.lower <= truth + 1e-12 && truth - 1e-12 <= answer.upper, "{truth}: {answer:?}");
            let [x, y] = answer.witnesses.expect("witnesses");
            assert!(((x - y).norm() - truth).abs() < 1e-6, "{truth}: {answer:?}");
            let [gradient, other] = answer.gradients.expect("gradients");
            assert!((gradient.linear.norm() - 1.0).abs() < 1e-9 && (gradient.linear + other.linear).norm() < 1e-12);
        }
        assert_eq!(found[2].verdict, Some(Verdict::No));
    }
}

/// Above floors that stand, that were moved and that were turned: on either side of contact and
/// of a threshold, with the floor first and last.
#[test]
fn capsules_above_floors_are_decided_on_both_sides() {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.1));
    // The floor of the room is 2 m below its frame.
    for (turn, moved) in [(UnitQuaternion::identity(), 0.0), (UnitQuaternion::identity(), 0.7), (turn, -0.4)] {
        let normal = turn * Vector3::z();
        // Turned about its own origin, and that many metres up along its normal.
        let floor_pose = Pose::from_quaternion(normal * moved, turn.coords.into()).expect("a pose");
        // How high the middle of the limb is above a plane that its lower end touches, metres.
        let middle = LIMB.0 + LIMB.1 * normal.z;
        for gap in [-0.3, -1e-9, 1e-9, 0.2 - 1e-9, 0.2 + 1e-9, 0.3] {
            let place = normal * (moved - 2.0 + middle + gap);
            let poses = vec![("floor".into(), floor_pose), ("limb".into(), at(place.x, place.y, place.z))];
            let scene = room().updated(&Update { poses, ..Update::default() }, |_| None).expect("an update");
            for names in [["limb", "floor"], ["floor", "limb"]] {
                for (threshold, measure) in [(0.0, Measure::Overlap), (0.2, Measure::NearerThan)] {
                    let ask = Ask::new(vec![measure]).expect("a measure").with_threshold(threshold).expect("a length");
                    let operands = names.map(|name| Operand::Object(slot(&scene, name))).to_vec();
                    let found = answers(&scene, ask, operands)[0];
                    let expected = if gap < threshold { Verdict::Yes } else { Verdict::No };
                    assert_eq!(found.verdict, Some(expected), "{names:?}, {moved}, {gap:e}, {threshold}: {found:?}");
                }
            }
        }
    }
}

/// Depths are known as long as the axis is outside; what has no polynomial has no level.
#[test]
fn depths_of_capsules_and_what_is_not_defined() {
    let scene = room();
    let moved = Update {
        poses: vec![("crate".into(), at(0.25, 0.0, 0.0)), ("lying".into(), at(0.0, 0.0, 0.0))],
        ..Update::default()
    };
    let scene = scene.updated(&moved, |_| None).expect("an update");
    let object = |name: &str| Operand::Object(slot(&scene, name));
    let measures = vec![Measure::Signed, Measure::Distance, Measure::Penetration, Measure::Overlap, Measure::LevelAOnB];
    let ask = || Ask::new(measures.clone()).expect("measures");
    let found = answers(&scene, ask(), vec![object("limb"), object("crate")]);
    assert!((found[0].value + 0.05).abs() < 1e-9 && found[0].status == AnswerStatus::Converged, "{:?}", found[0]);
    assert!(found[1].upper == 0.0 && found[1].status == AnswerStatus::Converged, "{:?}", found[1]);
    assert!((found[2].value - 0.05).abs() < 1e-9, "{:?}", found[2]);
    assert_eq!(found[3].verdict, Some(Verdict::Yes));
    assert_eq!(found[4].status, AnswerStatus::NotDefined);
    // On one another: axes meet.
    let found = answers(&scene, ask(), vec![object("limb"), object("lying")]);
    assert!(found[0].upper <= -2.0 * LIMB.0 + 1e-6, "{:?}", found[0]);
    assert_eq!(found[3].verdict, Some(Verdict::Yes));
}

/// What stands is found by its box among many, and capsules and floors find each other.
#[test]
fn capsules_are_found_among_many() {
    let scene = room();
    let dot = Body::ball("dot", Vector3::zeros(), 0.01).expect("a ball");
    let dots: Vec<Geometry> = vec![dot.into()];
    let mut update = Update::default();
    for index in 0..100 {
        let place = at(50.0 + f64::from(index), 0.0, 0.0);
        update.upserts.push(placement(&format!("dot {index}"), &dots[0], place));
    }
    let scene = scene.updated(&update, lookup(&dots)).expect("an update");
    let crew = Crew::new(2).expect("threads");
    // Into the crate, onto the lying limb, into the floor, and nowhere.
    let places = [[1.0, 0.0, 0.0], [0.0, 0.0, 0.65], [0.0, 0.0, -1.5], [0.0, 0.0, -1.35]];
    let poses: Vec<f64> = places.into_iter().flat_map(|[x, y, z]| [x, y, z, 0.0, 0.0, 0.0, 1.0]).collect();
    let states = States::new(scene.clone(), &[slot(&scene, "limb")], poses, 0.0, false).expect("states");
    let found = crew.ask(Arc::new(states), Arc::default()).expect("answered").concat();
    use StateVerdict::{Contact, Free};
    assert_eq!(found.iter().map(|answer| answer.verdict).collect::<Vec<_>>(), [Contact, Contact, Contact, Free]);
    let question =
        Within::new(scene.clone(), Ask::new(vec![Measure::Distance]).expect("measures"), Selection::all(), 1.45);
    let (near, _) = combined(&scene, crew.ask(Arc::new(question), Arc::default()).expect("answered"));
    let pair = [slot(&scene, "limb"), slot(&scene, "floor")];
    assert!(near.iter().any(|found| found.pair == pair || found.pair == [pair[1], pair[0]]), "{near:?}");
}

/// Beside a set that is not convex a capsule is free of what contains it, or it is open.
#[test]
fn beside_a_ring_it_is_free_or_open() {
    let scene = room();
    let operands = |scene: &Scene| ["limb", "ring"].map(|name| Operand::Object(slot(scene, name))).to_vec();
    let ask = || Ask::new(vec![Measure::Distance, Measure::Overlap]).expect("measures");
    let found = answers(&scene, ask(), operands(&scene));
    assert!(found[0].lower > 1.6 && found[0].upper == f64::INFINITY, "{:?}", found[0]);
    assert_eq!(found[1].verdict, Some(Verdict::No));
    let inside = Update { poses: vec![("ring".into(), at(0.0, 0.0, 0.0))], ..Update::default() };
    let scene = scene.updated(&inside, |_| None).expect("an update");
    let found = answers(&scene, ask(), operands(&scene));
    assert_eq!(found[1].verdict, Some(Verdict::Undecided));
}

#[test]
fn states_rays_and_neighbours_of_capsules() {
    let scene = room();
    let crew = Crew::new(2).expect("threads");
    let xs = [0.0, 0.69, 0.71, 1.0, 1.29, 1.31];
    let poses: Vec<f64> = xs.into_iter().flat_map(|x| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]).collect();
    let states = States::new(scene.clone(), &[slot(&scene, "limb")], poses, 0.0, false).expect("states");
    let found = crew.ask(Arc::new(states), Arc::default()).expect("answered").concat();
    use StateVerdict::{Contact, Free};
    let verdicts: Vec<_> = found.iter().map(|answer| answer.verdict).collect();
    assert_eq!(verdicts, [Free, Free, Contact, Contact, Contact, Free]);

    let question =
        Within::new(scene.clone(), Ask::new(vec![Measure::Distance]).expect("measures"), Selection::all(), 0.55);
    let (near, complete) = combined(&scene, crew.ask(Arc::new(question), Arc::default()).expect("answered"));
    let mut pair = [slot(&scene, "limb"), slot(&scene, "lying")];
    pair.sort_by_key(|&slot| scene.object(slot).map(|object| object.name.clone()));
    assert!(complete && near.iter().any(|found| found.pair == pair), "{near:?}");

    // Along x at the height of the limb, beside it, and onto its upper end.
    let rays = [
        (Vector3::new(-0.6, 0.0, -0.45), Vector3::x()),
        (Vector3::new(-0.6, 0.11, -0.45), Vector3::x()),
        (Vector3::new(0.06, 0.0, 1.0), -Vector3::z()),
        (Vector3::new(0.0, 0.05, 0.0), Vector3::x()),
    ];
    let only = Selection::of(&scene, [slot(&scene, "limb")], &HashSet::new());
    let question = |radius: f64| Rays::new(scene.clone(), only.clone(), &rays, (10.0, radius)).expect("rays");
    let cast = |radius: f64| crew.ask(Arc::new(question(radius)), Arc::default()).expect("answered").concat();
    let found = cast(0.0);
    for (answer, truth) in [(&found[0], 0.5), (&found[2], 0.5 - 0.08), (&found[3], 0.0)] {
        assert!(answer.lower_m <= truth + 1e-12 && truth - 1e-12 <= answer.upper_m, "{truth}: {answer:?}");
        assert_eq!(answer.status, AnswerStatus::Converged, "{truth}: {answer:?}");
    }
    assert!(found[1].hit.is_none(), "{:?}", found[1]);
    // A ball of 0.05 m touches 0.1 m · (1 - sin) earlier.
    let touching = cast(0.05);
    let truth = 0.6 - (0.15_f64.powi(2) - 0.11_f64.powi(2)).sqrt();
    assert!((touching[1].upper_m - truth).abs() < 1e-9, "{:?}", touching[1]);
    let normal = touching[1].normal.expect("a normal");
    assert!((touching[1].point.expect("a point") - Vector3::new(0.0, 0.0, -0.45) - normal * 0.1).norm() < 1e-9);
}

/// A capsule that moves among bodies, and a body that moves about a capsule: state by state the
/// rows are those of single queries.
#[test]
fn clearances_of_capsules_are_those_of_single_queries() {
    let crew = Crew::new(2).expect("threads");
    let scene = room();
    let ask = Ask::new(vec![Measure::Signed]).expect("measures");
    for (seed, (mover, middle)) in [("limb", [-1.0, 0.0, 0.2]), ("egg", [0.0, 0.0, 0.0])].into_iter().enumerate() {
        let mut random = Seeded(seed as u64);
        let moving = slot(&scene, mover);
        let places: Vec<Pose> = (0..60)
            .map(|i| random.pose(if i % 4 == 0 { 0.2 } else { 1.2 }))
            .map(|pose| pose.with_translation(pose.translation() + Vector3::from(middle)))
            .collect();
        let packed = places.iter().flat_map(|pose| {
            let (t, q) = (pose.translation(), pose.rotation().coords);
            [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
        });
        let influence = 0.6;
        let question = Clearance::new(scene.clone(), &[moving], packed.collect(), influence, false).expect("states");
        let states = crew.ask(Arc::new(question), Arc::default()).expect("answered").concat();
        let (mut beside_capsule, mut met) = (0, 0);
        for (state, (found, place)) in states.iter().zip(&places).enumerate() {
            let posed = scene.posed(&[(moving, *place)]).expect("a pose");
            for other in ["limb", "lying", "crate", "egg", "pair"].into_iter().filter(|name| *name != mover) {
                let pair = [moving, slot(&scene, other)];
                let pairs = Pairs::new(posed.clone(), ask.clone(), pair.map(Operand::Object).to_vec(), vec![[0, 1]]);
                let single = crew.ask(Arc::new(pairs.expect("a pair")), Arc::default()).expect("answered").concat();
                let (single, row) = (&single[0], found.rows.iter().find(|row| row.pair == pair));
                let label = format!("{mover} {state} {other}: {row:?} {single:?}");
                let Some(row) = row else {
                    assert!(single.upper > influence, "{label}");
                    continue;
                };
                let answer = &row.answer;
                let with_capsule = mover != "egg" || ["limb", "lying"].contains(&other);
                assert!(single.lower <= influence, "{label}");
                assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{label}");
                assert_eq!(answer.status, single.status, "{label}");
                assert_eq!(answer.witnesses.is_some(), single.witnesses.is_some(), "{label}");
                match (answer.normal, single.normal) {
                    // Depths of bodies have wider brackets.
                    _ if !with_capsule => continue,
                    (Some(n), Some(m)) => {
                        assert!((n - m).norm() < 1e-6, "{label}");
                        let [on_mover, on_other] = answer.witnesses.expect("witnesses");
                        assert!((on_mover - on_other - n * answer.upper).norm() < 1e-6, "{label}");
                        let [of_mover, of_other] = answer.gradients.expect("gradients").map(|twist| twist.linear);
                        assert!((of_mover - n).norm() < 1e-12 && (of_other + n).norm() < 1e-12, "{label}");
                    }
                    (n, m) => {
                        assert_eq!(n.is_some(), m.is_some(), "{label}");
                        met += 1;
                    }
                }
                beside_capsule += 1;
            }
        }
        println!("{mover}: {beside_capsule} rows with a capsule, {met} without a normal");
        assert!(beside_capsule > 20 && met > 0, "{mover}: {beside_capsule} {met}");
    }
}

#[test]
fn files_of_capsules_are_read_back() {
    let mut random = Seeded(2);
    for _ in 0..200 {
        let capsule = Capsule::new(random.signed().abs(), random.signed().abs()).expect("a capsule");
        let geometry = Geometry::from(NamedCapsule::new("limb", capsule).expect("a name"));
        let again = Geometry::from_json(&geometry.to_json()).expect("a file");
        let Geometry::Capsule(read) = &again else { panic!("{again:?}") };
        assert!(*read.capsule() == capsule && read.id() == geometry.id() && read.name() == "limb");
    }
    let text = Geometry::from(NamedCapsule::new("limb", Capsule::new(1.0, 2.0).expect("a capsule")).expect("a name"))
        .to_json();
    for (change, word) in [("\"radius_m\":1.0", "radius"), ("\"half_height_m\":2.0", "half height")] {
        let bad = text.replace(char::is_whitespace, "").replace(change, &change.replace(':', ":-"));
        let error = Geometry::from_json(&bad).expect_err("a negative size").to_string();
        assert!(error.contains(word), "{error}");
    }
}
