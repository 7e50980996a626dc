//! States and clearances by joint values, against poses of the links and differences.

use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::measure::PoseError;
use sublevel_robot::ConfigurationError;
use sublevel_scene::query::{
    Clearance, InvalidState, JointValues, StateAnswer, StateClearance, StateVerdict, States, StatesError,
};
use sublevel_scene::{Attach, Crew, Question, Scene, Slot, Update};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::at;

use super::{applied, cell, set, slot, things, values};
use crate::worlds::placement;

fn ask<Q: Question<Part = Vec<T>>, T: Clone>(question: Q) -> Vec<T> {
    Crew::new(2).expect("threads").ask(Arc::new(question), Arc::default()).expect("answered").concat()
}

fn states(scene: &Scene, joints: &[&str], values: &[f64]) -> Vec<StateAnswer> {
    let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
    ask(States::of_joints(
        scene.clone(),
        JointValues { robot: "arm", joints: &joints, values: values.to_vec() },
        0.0,
        false,
    )
    .expect("states"))
}

fn clearance(scene: &Scene, joints: &[&str], values: &[f64]) -> Vec<StateClearance> {
    let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
    ask(Clearance::of_joints(
        scene.clone(),
        JointValues { robot: "arm", joints: &joints, values: values.to_vec() },
        0.3,
        false,
    )
    .expect("states"))
}

/// The arm among boxes and balls.
fn clutter(seed: u64, count: usize) -> Scene {
    let (mut random, mut update) = (Seeded(seed), Update::default());
    for index in 0..count {
        let shift = Vector3::new(1.0, 0.0, 0.5) + random.unit() * (0.6 + 0.8 * random.positive());
        let place = sublevel_testkit::random::pose(shift, &random.rotation());
        update.upserts.push(placement(&format!("o{index}"), &things()[index % 2], place));
    }
    applied(&cell(&[]), &update)
}

fn configuration(random: &mut Seeded) -> [f64; 4] {
    [2.5 * random.signed(), 3.0 * random.signed(), 9.0 * random.signed(), 0.05 * random.positive()]
}

#[test]
fn joint_values_are_what_the_poses_of_links_are() {
    let mut tally = [0; 2];
    // Few objects are looked at one by one, many through the tree.
    for (seed, count) in [(1, 12), (2, 100)] {
        let (scene, mut random) = (clutter(seed, count), Seeded(seed));
        let links: Vec<Slot> = scene.robot("arm").expect("there").link_slots().iter().flatten().copied().collect();
        let (mut packed, mut poses) = (Vec::new(), Vec::new());
        for _ in 0..100 {
            let configuration = configuration(&mut random);
            let there = applied(&scene, &set("arm", values(&[], &configuration)));
            packed.extend(configuration);
            for &link in &links {
                let pose = there.pose(link).expect("a pose");
                poses.extend(pose.translation().iter().chain(pose.rotation().coords.iter()));
            }
        }
        let by_joints = states(&scene, &[], &packed);
        let by_poses = ask(States::new(scene.clone(), &links, poses.clone(), 0.0, false).expect("states"));
        for (state, (joints, poses)) in by_joints.iter().zip(&by_poses).enumerate() {
            assert_eq!(joints.verdict, poses.verdict, "seed {seed} {state}: {joints:?} {poses:?}");
            assert_eq!(joints.pair, poses.pair, "seed {seed} {state}");
            tally[usize::from(joints.verdict == StateVerdict::Free)] += 1;
        }
        let worst = States::of_joints(
            scene.clone(),
            JointValues { robot: "arm", joints: &[], values: packed.clone() },
            0.0,
            false,
        )
        .expect("states");
        let worst = ask(worst.with_worst_pair(None).expect("an accuracy"));
        for (state, (found, worst)) in by_joints.iter().zip(&worst).enumerate() {
            assert_eq!(found.verdict, worst.verdict, "seed {seed} {state}: {found:?} {worst:?}");
        }
        let by_joints = clearance(&scene, &[], &packed);
        let by_poses = ask(Clearance::new(scene.clone(), &links, poses, 0.3, false).expect("states"));
        for (joints, poses) in by_joints.iter().zip(&by_poses) {
            assert!(joints.checked && joints.rows.len() == poses.rows.len());
            for (a, b) in joints.rows.iter().zip(&poses.rows) {
                assert_eq!(a.pair, b.pair);
                assert!(a.answer.lower <= b.answer.upper && b.answer.lower <= a.answer.upper);
            }
        }
    }
    assert!(tally.iter().all(|&count| count > 20), "{tally:?}");
}

#[test]
fn joints_that_are_not_named_stay_as_in_the_scene() {
    let scene = applied(&clutter(3, 20), &set("arm", values(&[], &[0.3, -0.4, 1.0, 0.02])));
    let named = states(&scene, &["spin", "bend"], &[1.0, -0.4, -2.0, 0.9]);
    let all = states(&scene, &[], &[0.3, -0.4, 1.0, 0.02, 0.3, 0.9, -2.0, 0.02]);
    for (named, all) in named.iter().zip(&all) {
        assert_eq!((named.verdict, named.pair), (all.verdict, all.pair));
    }
}

#[test]
fn values_that_are_none_make_a_state_invalid_and_no_other() {
    let scene = cell(&[]);
    let nan = f64::NAN;
    let packed = [[0.0; 4], [nan, 0.0, 0.0, 0.0], [2.6, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, -0.01], [0.0, 0.0, 1e9, 0.0]];
    let found: Vec<_> = states(&scene, &[], packed.as_flattened()).iter().map(|answer| answer.verdict).collect();
    let (free, invalid) = (StateVerdict::Free, StateVerdict::Invalid);
    assert_eq!(found, [free, invalid, invalid, invalid, free]);
    let found = clearance(&scene, &[], packed.as_flattened());
    assert_eq!(found.iter().map(|state| state.checked).collect::<Vec<_>>(), [true, false, false, false, true]);
    // Which joint, and why; of valid states nothing.
    let limits = |joint: &str, value: f64, lower: f64, upper: f64| {
        InvalidState::Joints(ConfigurationError::Limits { joint: joint.into(), value, lower, upper })
    };
    let of_states = states(&scene, &[], packed.as_flattened());
    for (answer, near) in of_states.iter().zip(&found) {
        assert_eq!(answer.invalid.as_ref().map(ToString::to_string), near.invalid.as_ref().map(ToString::to_string));
    }
    let said: Vec<Option<InvalidState>> = of_states.into_iter().map(|answer| answer.invalid.map(|why| *why)).collect();
    let not_finite = said[1].as_ref().expect("a reason");
    assert_eq!(not_finite.to_string(), "joint shoulder is NaN; give a finite number");
    let expected = [limits("shoulder", 2.6, -2.5, 2.5), limits("slide", -0.01, 0.0, 0.05)].map(Some);
    assert_eq!((&said[2..4], &said[0], &said[4]), (&expected[..], &None, &None));
    // A state of some joints is counted whole, and names its own.
    let of_one = states(&scene, &["bend"], &[0.0, 3.5]);
    assert_eq!(of_one[1].invalid.as_deref(), Some(&limits("bend", 3.5, -3.0, 3.0)));
}

#[test]
fn poses_that_are_none_make_a_state_invalid_and_no_other() {
    // What the ball holds reaches farther than poses do when the ball is there.
    let attach = Attach { name: "held".into(), to: "ball".into(), pose: Some(at(2e14, 0.0, 0.0)), touch: Vec::new() };
    let held = placement("held", &things()[1], at(0.0, 0.0, 0.0));
    let update = Update { upserts: vec![held], ..Update::default() };
    let scene = applied(&applied(&cell(&[]), &update), &Update { attach: vec![attach], ..Update::default() });
    // Two objects a state: the tool, which is held by the wrist, and the ball.
    let slots = [slot(&scene, "tool"), slot(&scene, "ball")];
    let good = [9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let [mut nan, mut long, mut far, mut aside] = [good; 4];
    (nan[1], long[6], far[0], aside[0]) = (f64::NAN, 1.5, 9e14, -9.0);
    let packed = [aside, good, aside, nan, long, good, aside, far];
    let pose = |object: &str, pose: usize, error: PoseError| {
        Some(InvalidState::Pose { object: object.into(), pose: Some(pose), error })
    };
    let expected = [
        None,
        pose("ball", 3, PoseError::NotFinite { field: "translation" }),
        pose("tool", 4, PoseError::NotUnit(0.5)),
        pose("held", 7, PoseError::TooFar(9e14 + 2e14)),
    ];
    let numbers = packed.as_flattened().to_vec();
    let found = ask(States::new(scene.clone(), &slots, numbers.clone(), 0.0, false).expect("states"));
    for (state, (answer, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!(answer.invalid.as_deref(), expected.as_ref(), "{state}");
        assert_eq!(answer.verdict == StateVerdict::Invalid, expected.is_some(), "{state}: {answer:?}");
    }
    let text = "object \"tool\" has no usable pose: rotation is not a unit quaternion";
    assert!(found[2].invalid.as_ref().expect("a reason").to_string().starts_with(text));
    let found = ask(Clearance::new(scene.clone(), &slots, numbers, 0.1, false).expect("states"));
    for (state, (near, expected)) in found.iter().zip(&expected).enumerate() {
        assert_eq!((near.invalid.as_deref(), near.checked), (expected.as_ref(), expected.is_none()), "{state}");
    }
}

#[test]
fn questions_that_are_none_are_refused() {
    let scene = cell(&[]);
    let refused = |robot: &str, joints: &[&str], values: &[f64]| {
        let joints: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
        let question = States::of_joints(
            scene.clone(),
            JointValues { robot, joints: &joints, values: values.to_vec() },
            0.0,
            false,
        );
        question.expect_err("refused").to_string()
    };
    assert!(refused("leg", &[], &[0.0; 4]).starts_with("no robot \"leg\""));
    assert!(refused("arm", &[], &[0.0; 5]).contains("no multiple of 4"));
    assert!(refused("arm", &["bend"], &[]).contains("at least one state"));
    assert!(refused("arm", &["knee"], &[0.0]).contains("\"shoulder\", \"bend\", \"spin\", \"slide\""));
    assert!(refused("arm", &["follow"], &[0.0]).contains("no joint \"follow\""), "a mimic joint");
    assert!(refused("arm", &["bend", "bend"], &[0.0; 2]).contains("named twice"));
    let question =
        Clearance::of_joints(scene.clone(), JointValues { robot: "leg", joints: &[], values: vec![0.0] }, 0.1, false);
    assert_eq!(question.expect_err("refused"), StatesError::NoRobot("leg".into()));
}

#[test]
fn gradients_are_those_of_differences() {
    let (scene, mut random) = (clutter(4, 40), Seeded(4));
    let (mut checked, step) = (0, 1e-6);
    for _ in 0..30 {
        let at = configuration(&mut random);
        let mut packed = at.to_vec();
        for joint in 0..4 {
            for sign in [-1.0, 1.0] {
                let mut moved = at;
                moved[joint] += sign * step;
                moved[3] = moved[3].max(0.0);
                packed.extend(moved);
            }
        }
        let found = clearance(&scene, &[], &packed);
        for (index, row) in found[0].rows.iter().enumerate() {
            let gradient = &found[0].joint_gradients[4 * index..4 * index + 4];
            if row.answer.not_unique || row.answer.gradients.is_none() || row.answer.lower <= 1e-3 {
                continue;
            }
            for joint in 0..4 {
                let value = |state: usize| {
                    let row = found[state].rows.iter().find(|other| other.pair == row.pair)?;
                    (!row.answer.not_unique).then_some(row.answer.value)
                };
                let (Some(minus), Some(plus)) = (value(1 + 2 * joint), value(2 + 2 * joint)) else { continue };
                let difference = (plus - minus) / (2.0 * step);
                if at[3] < step || (difference - gradient[joint]).abs() > 1e-3 {
                    // A corner between two minimisers is rare, and no derivative.
                    let second = (plus - 2.0 * row.answer.value + minus) / (step * step);
                    assert!(second.abs() > 1e2, "{:?} {joint}: {difference} {}", row.pair, gradient[joint]);
                    continue;
                }
                checked += 1;
            }
        }
        let named = clearance(&scene_at(&scene, &at), &["slide", "bend"], &[at[3], at[1]]);
        for (index, row) in named[0].rows.iter().enumerate() {
            let same = found[0].rows.iter().position(|other| other.pair == row.pair).expect("the same rows");
            let all = &found[0].joint_gradients[4 * same..4 * same + 4];
            for (some, all) in named[0].joint_gradients[2 * index..].iter().zip([all[3], all[1]]) {
                assert!((some - all).abs() < 1e-6 || some.is_nan() && all.is_nan());
            }
        }
    }
    assert!(checked > 500, "{checked}");
}

fn scene_at(scene: &Scene, configuration: &[f64]) -> Scene {
    applied(scene, &set("arm", values(&[], configuration)))
}

/// The ball touches the tool exactly: rounding decides, so nothing is claimed.
#[test]
fn what_rounding_may_change_is_not_decided() {
    // The upper side of the tool is at z = 1.35 + 0.05.
    for (height, expected) in
        [(1.5, StateVerdict::Undecided), (1.5 - 1e-9, StateVerdict::Contact), (1.5 + 1e-9, StateVerdict::Free)]
    {
        let up = Update { poses: vec![("ball".into(), at(1.0, 0.0, height))], ..Update::default() };
        let scene = applied(&cell(&[]), &up);
        let found = states(&scene, &[], &[0.0; 4]).remove(0);
        assert_eq!(found.verdict, expected, "{found:?}");
        if expected != StateVerdict::Free {
            assert_eq!(found.pair, Some([slot(&scene, "tool"), slot(&scene, "ball")]));
            assert!(found.lower_m <= height - 1.5 + 1e-15 && height - 1.5 - 1e-15 <= found.upper_m, "{found:?}");
        }
    }
}
