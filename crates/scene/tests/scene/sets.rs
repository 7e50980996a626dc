//! Scenes with sets that are not convex: a ring is free where its box is not.

use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::body::{Body, Compound};
use sublevel_core::measure::HalfSpace;
use sublevel_scene::query::{
    Answer, AnswerStatus, Ask, Clearance, Measure, Operand, Pairs, PairsError, Selection, StateVerdict, States,
    Verdict, Within, closest_pair, combined,
};
use sublevel_scene::{Crew, Geometry, Scene, Stop, Update};
use sublevel_testkit::random::at;
use sublevel_testkit::sos_bodies::torus;

use crate::worlds::{floor, lookup, placement};

/// Tube radius of the ring about the unit circle, metres.
const TUBE: f64 = 0.2;

/// A ring about z at the origin, a ball in the middle of it, two balls above, a floor 2 m below.
fn ring() -> Scene {
    let ball = |x: f64, radius: f64| Body::ball("ball", Vector3::new(x, 0.0, 0.0), radius).expect("a ball");
    let pair = Compound::new("pair", vec![ball(-0.5, 0.1), ball(1.0, 0.1)]).expect("a compound");
    let bodies: Vec<Geometry> = vec![torus(TUBE).into(), ball(0.0, 0.3).into(), pair.into(), floor()];
    let mut update = Update::default();
    update.upserts.push(placement("ring", &bodies[0], at(0.0, 0.0, 0.0)));
    update.upserts.push(placement("middle", &bodies[1], at(0.0, 0.0, 0.0)));
    update.upserts.push(placement("above", &bodies[2], at(0.0, 0.0, 1.3)));
    update.upserts.push(placement("other", &bodies[0], at(0.0, 0.0, 5.0)));
    update.upserts.push(placement("floor", &bodies[3], at(0.0, 0.0, 0.0)));
    Scene::new("ring", 0).expect("a name").updated(&update, lookup(&bodies)).expect("an update")
}

/// Relative to the smaller of a pair; all pairs of points of a ring and of what is in the middle of
/// it are as near as others, which takes many boxes.
const ACCURACY: f64 = 3e-3;

fn ask(measures: &[Measure]) -> Ask {
    Ask::new(measures.to_vec()).expect("measures").with_accuracy(ACCURACY).expect("an accuracy")
}

fn answers(scene: &Scene, ask: Ask, operands: Vec<Operand>) -> Vec<Answer> {
    let pairs = (1..operands.len() as u32).map(|other| [0, other]).collect();
    let question = Pairs::new(scene.clone(), ask, operands, pairs).expect("pairs");
    let crew = Crew::new(2).expect("threads");
    crew.ask(Arc::new(question), Arc::default()).expect("answered").concat()
}

fn slot(scene: &Scene, name: &str) -> u32 {
    scene.slot(name).expect("an object")
}

#[test]
fn distances_are_those_of_the_ring_and_not_of_its_box() {
    let scene = ring();
    let object = |name: &str| Operand::Object(slot(&scene, name));
    let wall = HalfSpace::new(-Vector3::x(), -3.0).expect("a half-space");
    let operands = vec![
        object("ring"),
        object("middle"),
        object("above"),
        object("other"),
        object("floor"),
        Operand::Point(Vector3::new(0.0, 0.5, 0.0)),
        Operand::HalfSpace(wall),
    ];
    let mut asked = ask(&[Measure::Distance, Measure::Signed, Measure::Overlap]);
    asked.gradients = true;
    // The ring is hardly smaller than stated.
    let truths = [0.5, 1.3 - TUBE - 0.1, 5.0 - 2.0 * TUBE, 2.0 - TUBE, 0.3, 3.0 - 1.0 - TUBE];
    for (found, truth) in answers(&scene, asked, operands).chunks(3).zip(truths) {
        for answer in &found[..2] {
            assert_eq!(answer.status, AnswerStatus::Converged, "{truth}: {answer:?}");
            assert!(answer.lower <= truth + 1e-4 && answer.upper >= truth - 1e-4, "{truth}: {answer:?}");
            assert!(answer.upper - answer.lower <= 2.0 * ACCURACY, "{truth}: {answer:?}");
            let [x, y] = answer.witnesses.expect("witnesses");
            assert!(((x - y).norm() - answer.upper).abs() < 1e-9, "{truth}: {answer:?}");
            let [gradient, other] = answer.gradients.expect("gradients");
            assert!((gradient.linear.norm() - 1.0).abs() < 1e-9 && gradient.linear == -other.linear);
        }
        assert_eq!(found[2].verdict, Some(Verdict::No));
    }
}

#[test]
fn levels_and_decisions_are_proven_on_both_sides() {
    let scene = ring();
    let object = |name: &str| Operand::Object(slot(&scene, name));
    let measures = [Measure::LevelAOnB, Measure::LevelBOnA, Measure::NearerThan];
    let asked = ask(&measures).with_threshold(0.6).expect("a threshold");
    let found = answers(&scene, asked, vec![object("ring"), object("middle"), object("above"), object("other")]);
    // Of the ring at the ball's equator: ((0.3² - 1 - r²)² + 0) / 4 r²; of the ball at the inner
    // circle.
    let ring_at = (0.09 - 1.0 - TUBE * TUBE).powi(2) / (4.0 * TUBE * TUBE);
    let ball_at = (0.8 / 0.3_f64).powi(2);
    for (answer, truth) in [(&found[0], ring_at), (&found[1], ball_at)] {
        assert_eq!(answer.status, AnswerStatus::Converged, "{answer:?}");
        assert!((answer.value - truth).abs() < ACCURACY * truth, "{truth}: {answer:?}");
    }
    let verdicts: Vec<_> = found.chunks(3).map(|answers| answers[2].verdict).collect();
    assert_eq!(verdicts, [Some(Verdict::Yes), Some(Verdict::No), Some(Verdict::No)]);
    // In the tube: nearer than any length, 0 m included.
    let asked = ask(&[Measure::NearerThan, Measure::Overlap]);
    let moved = Update { poses: vec![("middle".into(), at(0.6, 0.0, 0.0))], ..Update::default() };
    let in_tube = scene.updated(&moved, |_| None).expect("an update");
    let found = answers(&in_tube, asked, vec![object("ring"), object("middle")]);
    assert_eq!([found[0].verdict, found[1].verdict], [Some(Verdict::Yes); 2], "{found:?}");
    for measure in [Measure::Growth, Measure::Penetration, Measure::TimeOfImpact] {
        let operands = vec![object("middle"), object("above"), object("ring")];
        let refused = Pairs::new(scene.clone(), ask(&[measure]), operands, vec![[0, 1], [1, 2]]);
        assert_eq!(refused.expect_err("not convex"), PairsError::NeedsConvex { pair: 1, measure });
    }
}

/// The signed distance of a half-space is known on both sides of contact.
#[test]
fn depths_in_half_spaces_are_measured() {
    let scene = ring();
    let ring = Operand::Object(slot(&scene, "ring"));
    for (offset, truth) in [(-1.0, 1.0 - TUBE), (-0.1, 0.1 - TUBE), (0.0, -TUBE)] {
        let floor = Operand::HalfSpace(HalfSpace::new(Vector3::z(), offset).expect("a half-space"));
        let measures = [Measure::Signed, Measure::Distance, Measure::Penetration, Measure::Overlap];
        let asked = ask(&measures[..if truth > 0.0 { 2 } else { 4 }]);
        let found = answers(&scene, asked, vec![ring, floor]);
        assert!((found[0].value - truth).abs() < 2.0 * ACCURACY, "{offset}: {:?}", found[0]);
        assert!((found[1].value - truth.max(0.0)).abs() < 2.0 * ACCURACY, "{offset}: {:?}", found[1]);
        if truth < 0.0 {
            assert!((found[2].value + truth).abs() < 2.0 * ACCURACY, "{offset}: {:?}", found[2]);
            assert_eq!(found[3].verdict, Some(Verdict::Yes), "{offset}: {:?}", found[3]);
        }
    }
}

#[test]
fn states_pass_through_the_hole_and_touch_the_tube() {
    let scene = ring();
    let crew = Crew::new(2).expect("threads");
    let poses: Vec<f64> =
        [0.0, 0.3, 0.49, 0.51, 0.8, 1.49, 1.51].into_iter().flat_map(|x| [x, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]).collect();
    let states = States::new(scene.clone(), &[slot(&scene, "middle")], poses.clone(), 0.0, false).expect("states");
    let found = crew.ask(Arc::new(states), Arc::default()).expect("answered").concat();
    let verdicts: Vec<_> = found.iter().map(|answer| answer.verdict).collect();
    use StateVerdict::{Contact, Free};
    assert_eq!(verdicts, [Free, Free, Free, Contact, Contact, Contact, Free]);

    let clearance = Clearance::new(scene.clone(), &[slot(&scene, "middle")], poses, 0.1, false).expect("states");
    let clearance = clearance.with_accuracy(ACCURACY).expect("an accuracy");
    let rows = crew.ask(Arc::new(clearance), Arc::default()).expect("answered").concat();
    let near: Vec<_> = rows.iter().map(|state| state.rows.len()).collect();
    assert_eq!(near, [0, 0, 1, 1, 1, 1, 1]);

    let question = Within::new(scene.clone(), ask(&[Measure::Distance]), Selection::all(), 0.55);
    let (found, complete) = combined(&scene, crew.ask(Arc::new(question), Arc::default()).expect("answered"));
    assert!(complete);
    let expected = [slot(&scene, "middle"), slot(&scene, "ring")];
    assert_eq!(found.iter().map(|found| found.pair).collect::<Vec<_>>(), [expected]);
    let stop: Arc<Stop> = Arc::default();
    let (closest, complete) =
        closest_pair(&crew, &stop, (&scene, &ask(&[Measure::Distance])), &Selection::all(), 10.0).expect("answered");
    assert!(complete);
    assert_eq!(closest.expect("a pair").pair, expected);
}
