//! Why a state is in contact, and what frees it.

use std::sync::Arc;

use sublevel_core::measure::{Pose, PoseError};
use sublevel_scene::query::{
    ExplainedState, Explanation, InvalidState, JointValues, StateVerdict, States, StatesError,
};
use sublevel_scene::{Crew, Scene, Slot, Update};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::at;

use super::{applied, cell, slot, things};
use crate::worlds::placement;

fn explained(scene: &Scene, joints: &[&str], values: &[f64], margin_m: f64) -> ExplainedState {
    let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
    let question = Explanation::of_joints(
        scene.clone(),
        JointValues { robot: "arm", joints: &joints, values: values.to_vec() },
        margin_m,
        false,
    )
    .expect("a state");
    Crew::new(1).expect("threads").ask(Arc::new(question), Arc::default()).expect("answered").remove(0)
}

fn verdict(scene: &Scene, joints: &[&str], values: &[f64], margin_m: f64) -> StateVerdict {
    let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
    let states = States::of_joints(
        scene.clone(),
        JointValues { robot: "arm", joints: &joints, values: values.to_vec() },
        margin_m,
        false,
    )
    .expect("states");
    Crew::new(1).expect("threads").ask(Arc::new(states), Arc::default()).expect("answered").concat()[0].verdict
}

/// The arm among balls and boxes that it can reach.
fn clutter(seed: u64, count: usize) -> Scene {
    let (mut random, mut update) = (Seeded(seed), Update::default());
    for index in 0..count {
        let shift = nalgebra::Vector3::new(1.0, 0.0, 0.5) + random.unit() * (0.6 + 0.8 * random.positive());
        let place = sublevel_testkit::random::pose(shift, &random.rotation());
        update.upserts.push(placement(&format!("o{index}"), &things()[index % 2], place));
    }
    applied(&cell(&[]), &update)
}

#[test]
fn freed_joint_values_are_free_and_verdicts_are_those_of_states() {
    let mut tally = [0; 3];
    for seed in 0..30 {
        let (scene, mut random) = (clutter(seed, 25), Seeded(seed));
        let values = [2.4 * random.signed(), 2.8 * random.signed(), 3.0 * random.signed(), 0.05 * random.positive()];
        let margin = 0.02 * random.positive();
        let found = explained(&scene, &[], &values, margin);
        assert_eq!(found.verdict, verdict(&scene, &[], &values, margin), "seed {seed}");
        assert_eq!(found.pairs.is_empty(), found.verdict == StateVerdict::Free, "seed {seed}");
        match &found.freed {
            Some(freed) => {
                assert_eq!(verdict(&scene, &[], freed, margin), StateVerdict::Free, "seed {seed}: {freed:?}");
                tally[0] += 1;
            }
            None if found.pairs.is_empty() => tally[1] += 1,
            None => tally[2] += 1,
        }
    }
    // Some hold an object that the base is in, too, and have no free one.
    assert!(tally[0] >= 8 && tally[1] >= 5, "freed, free, stuck: {tally:?}");
}

#[test]
fn an_object_that_is_moved_by_its_separation_is_free() {
    let mut moved = 0;
    for seed in 0..40 {
        let (scene, mut random) = (clutter(seed, 10), Seeded(seed));
        let thing = slot(&scene, "o0");
        // Onto another object, somewhat aside.
        let other = *scene.pose(slot(&scene, "o1")).expect("a pose");
        let shift = other.translation() + random.unit() * 0.1 * random.positive();
        let packed = |shift: nalgebra::Vector3<f64>| {
            let rotation = other.rotation().coords;
            vec![shift.x, shift.y, shift.z, rotation.x, rotation.y, rotation.z, rotation.w]
        };
        let ask = |poses: Vec<f64>| {
            let question = Explanation::new(scene.clone(), &[thing], poses, 0.01, false).expect("a state");
            Crew::new(1).expect("threads").ask(Arc::new(question), Arc::default()).expect("answered").remove(0)
        };
        let found = ask(packed(shift));
        assert!(found.freed.is_none(), "only joints are searched");
        for pair in &found.pairs {
            let (Some(normal), Some(separation)) = (pair.answer.normal, pair.separation_m) else { continue };
            let after = ask(packed(shift + normal * separation));
            let still = after.pairs.iter().find(|other| other.pair == pair.pair);
            assert!(still.is_none_or(|still| !still.is_contact), "seed {seed}: {pair:?} {still:?}");
            moved += 1;
        }
        let depths: Vec<f64> = found.pairs.iter().map(|pair| pair.answer.lower - pair.padding_m).collect();
        assert!(depths.is_sorted(), "seed {seed}: {depths:?}");
    }
    assert!(moved >= 30, "{moved}");
}

#[test]
fn joints_that_are_not_named_stay_and_gradients_are_of_those_named() {
    // The upper arm lies along x, 0.05 m thick, in a ball at its end.
    let quarter = std::f64::consts::FRAC_PI_2;
    let ball = placement("near", &things()[0], at(1.6, 0.0, 0.1));
    let scene = applied(&cell(&[]), &Update { upserts: vec![ball], ..Update::default() });
    let found = explained(&scene, &["shoulder"], &[quarter], 0.0);
    assert_eq!(found.verdict, StateVerdict::Contact);
    let pair = found.pairs.iter().find(|pair| pair.pair.contains(&slot(&scene, "near"))).expect("the ball");
    assert_eq!(pair.joint_gradient.len(), 1);
    assert!(pair.is_contact && pair.answer.upper < 0.0);
    let freed = found.freed.expect("the arm can swing away");
    assert_eq!(freed.len(), 1);
    assert_eq!(verdict(&scene, &["shoulder"], &freed, 0.0), StateVerdict::Free);
    // The slide moves nothing that is in contact.
    assert_eq!(explained(&scene, &["shoulder"], &[quarter], 0.0).pairs.len(), found.pairs.len());
    let stuck = Update { joints: vec![("arm".into(), super::values(&["shoulder"], &[quarter]))], ..Update::default() };
    let there = applied(&scene, &stuck);
    let found = explained(&there, &["slide"], &[0.01], 0.0);
    assert_eq!((found.verdict, found.freed), (StateVerdict::Contact, None));
    // Without values it is the state of the scene.
    assert_eq!(explained(&there, &[], &[], 0.0).verdict, StateVerdict::Contact);
}

#[test]
fn what_is_no_single_state_is_refused() {
    let scene = cell(&[]);
    let ball: [Slot; 1] = [slot(&scene, "ball")];
    let joints = |joints: &[&str], values: &[f64]| {
        let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
        Explanation::of_joints(
            scene.clone(),
            JointValues { robot: "arm", joints: &joints, values: values.to_vec() },
            0.0,
            false,
        )
        .map(drop)
        .expect_err("refused")
    };
    let wide = StatesError::OneState { numbers: 2, per_state: 1 };
    assert_eq!(joints(&["bend"], &[0.0, 0.1]), wide);
    assert!(matches!(joints(&["elbow"], &[0.0]), StatesError::Joints(_)));
    let pose = Pose::identity();
    let row: Vec<f64> = pose.translation().iter().chain(pose.rotation().coords.iter()).copied().collect();
    let two = Explanation::new(scene.clone(), &ball, [row.clone(), row].concat(), 0.0, false).map(drop);
    assert_eq!(two.expect_err("refused"), StatesError::Several(2));
    let nobody = Explanation::of_joints(
        scene.clone(),
        JointValues { robot: "nobody", joints: &[], values: Vec::new() },
        0.0,
        false,
    )
    .map(drop);
    assert!(matches!(nobody, Err(StatesError::NoRobot(_))));
}

#[test]
fn invalid_states_are_explained_by_what_is_wrong() {
    let scene = cell(&[]);
    for (value, why) in [
        (f64::NAN, "joint bend is NaN; give a finite number"),
        (9.0, "joint bend is 9, outside its limits -3 to 3; give a value within them"),
    ] {
        let found = explained(&scene, &["bend"], &[value], 0.0);
        assert_eq!((found.verdict, found.pairs.len(), found.freed), (StateVerdict::Invalid, 0, None));
        assert_eq!(found.invalid.expect("a reason").to_string(), why);
    }
    assert_eq!(explained(&scene, &["bend"], &[0.1], 0.0).invalid, None);
    let row = vec![5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0];
    let question = Explanation::new(scene.clone(), &[slot(&scene, "ball")], row, 0.0, false).expect("a state");
    let found = Crew::new(1).expect("threads").ask(Arc::new(question), Arc::default()).expect("answered").remove(0);
    let expected = InvalidState::Pose { object: "ball".into(), pose: Some(0), error: PoseError::NotUnit(1.0) };
    assert_eq!((found.verdict, found.invalid.as_deref()), (StateVerdict::Invalid, Some(&expected)));
}
