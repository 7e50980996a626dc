//! Clearances by the typed client, beside the same question in process.

use std::collections::BTreeMap;
use std::sync::Arc;

use sublevel::body::{Body, BodyId};
use sublevel::client::{ClearanceQuestion, Clearances, ClientError};
use sublevel::measure::Pose;
use sublevel::robot::{read_srdf, read_urdf};
use sublevel::scene::query::{Clearance, JointValues, StateClearance};
use sublevel::scene::{
    Attach, Geometry, NamedJointValues, PlaceRobot, Placement, Question, Robot, RobotId, Scene, Stop, Subject, Update,
};

use super::{SRDF, URDF, at, cell, served};
use crate::harness::ball;

/// States of both joints: two that are usable, one beyond its limits, one of NaN.
const VALUES: [f64; 8] = [0.3, 0.1, 1.2, 0.0, 2.5, 0.0, f64::NAN, 0.0];

/// The scene that [`cell`] makes, in process.
fn same_cell() -> Scene {
    let [hand, thing] = [ball(0.1), Body::ball("thing", nalgebra::Vector3::zeros(), 0.05).expect("a ball")];
    let [hand, thing] = [hand, thing].map(Geometry::from);
    let bodies = BTreeMap::from([(Arc::from("hand"), hand.clone())]);
    let description = read_urdf(URDF).expect("a robot");
    let semantics = read_srdf(SRDF, &description).expect("semantics");
    let id = RobotId::of(URDF, SRDF, [("hand", hand.id())]);
    let robot = Arc::new(Robot::new(id, &description, &semantics, &bodies).expect("a robot"));
    let place = |name: &str, x: f64| PlaceRobot {
        name: name.into(),
        robot: robot.clone(),
        base: at(x, 0.0, 0.0),
        joints: NamedJointValues::default(),
    };
    let put = |name: &str, pose: Pose| Placement {
        name: name.into(),
        body: *thing.id(),
        pose: Some(pose),
        group: "".into(),
        padding_m: None,
        attachment: None,
    };
    let attach = Attach {
        name: "held".into(),
        to: "one/hand".into(),
        pose: Some(at(0.0, 0.0, 0.3)),
        touch: vec![Subject::Object("one/finger".into())],
    };
    let robots = Update { robots: vec![place("one", 0.0), place("two", 3.0)], ..Update::default() };
    let upserts = vec![put("held", at(0.0, 0.0, 0.0)), put("post", at(3.0, 0.0, 2.0))];
    let lookup = |id: &BodyId| [&hand, &thing].into_iter().find(|body| body.id() == id).cloned();
    let mut scene = Scene::new("cell", 0).expect("a name");
    for update in [
        robots,
        Update { upserts, ..Update::default() },
        Update { attach: vec![attach], ..Update::default() },
        padding(),
    ] {
        scene = scene.updated(&update, lookup).expect("a scene");
    }
    scene
}

/// A padding, so that it shows in the rows.
fn padding() -> Update {
    Update { group_paddings: vec![("two".into(), Some(0.25))], ..Update::default() }
}

fn in_process(scene: &Scene, question: Clearance) -> Vec<StateClearance> {
    assert!(scene.len() > 5);
    (0..question.chunks()).flat_map(|chunk| question.solve(chunk, &Stop::default())).collect()
}

/// Every row has the same pair and the same bits.
fn same(scene: &Scene, width: usize, ours: &[StateClearance], theirs: &Clearances) {
    assert_eq!(ours.len(), theirs.states.len());
    for (ours, theirs) in ours.iter().zip(&theirs.states) {
        assert_eq!((ours.checked, ours.rows.len()), (theirs.checked, theirs.near.len()));
        for (index, (row, near)) in ours.rows.iter().zip(&theirs.near).enumerate() {
            let names = row.pair.map(|slot| scene.object(slot).expect("an object").name.to_string());
            assert_eq!((&names, row.padding_m), (&near.pair, near.padding_m));
            assert_eq!(row.answer.status, near.status);
            let numbers = [row.answer.lower, row.answer.upper];
            assert_eq!(numbers.map(f64::to_bits), [near.lower_m, near.upper_m].map(f64::to_bits), "{names:?}");
            assert_eq!((row.answer.normal, row.answer.gradients), (near.normal, near.gradients), "{names:?}");
            assert_eq!(row.answer.witnesses, near.witnesses_m, "{names:?}");
            assert_eq!((row.answer.not_unique, row.answer.one_sided), (near.not_unique, near.one_sided));
            let gradient = ours.joint_gradients.get(index * width..(index + 1) * width);
            let gradient = gradient.filter(|values| width > 0 && !values.iter().any(|value| value.is_nan()));
            assert_eq!(gradient, near.joint_gradient.as_deref(), "{names:?}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn clearances_of_the_client_are_those_of_the_library() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    client.update_scene("cell", &padding()).await.expect("padded");
    let scene = same_cell();
    // A robot, all its joints and one of them.
    for (joints, values) in [(vec![], &VALUES[..]), (vec!["lift"], &[0.3, 1.2][..])] {
        let ask = ClearanceQuestion::of_robot("one", joints.iter().copied(), 4.0).with_joint_values(values);
        let mut cold = ask.clone().with_witnesses();
        cold.request_mut().cold = true;
        let found = client.clearance("cell", cold).await.expect("answered");
        let names: Vec<Arc<str>> = joints.iter().map(|&name| name.into()).collect();
        let own = Clearance::of_joints(
            scene.clone(),
            JointValues { robot: "one", joints: &names, values: values.to_vec() },
            4.0,
            false,
        )
        .expect("a question");
        let own = in_process(&scene, own.cold());
        let width = if joints.is_empty() { 2 } else { 1 };
        same(&scene, width, &own, &found);
        let checked: Vec<bool> = found.states.iter().map(|state| state.checked).collect();
        assert_eq!(checked, if width == 2 { vec![true, true, false, false] } else { vec![true; 2] });
        let with_gradient = |state: &sublevel::client::StateClearance| {
            state.near.iter().filter(|near| near.joint_gradient.as_ref().is_some_and(|row| row.len() == width)).count()
        };
        assert!(found.states[..2].iter().all(|state| with_gradient(state) > 5), "{found:?}");
        assert!(found.revision > 0 && found.states[0].near.iter().any(|near| near.padding_m == 0.25));
        // The nearest pair alone, and no gradients.
        let nearest = client.clearance("cell", ask.with_max_pairs(1).without_gradients()).await.expect("answered");
        let [near] = &nearest.states[0].near[..] else { panic!("{nearest:?}") };
        assert_eq!(near.pair, found.states[0].closest().expect("a pair").pair);
        assert!(near.gradients.is_none() && near.joint_gradient.is_none() && near.witnesses_m.is_none());
        // The nearest with an object, whichever side it is on.
        let state = &found.states[0];
        for name in ["post", "one/arm", "two/finger"] {
            let with = state.near.iter().filter(|near| near.pair.contains(&name.to_owned()));
            let least = with.map(|near| near.lower_m - near.padding_m).fold(f64::INFINITY, f64::min);
            let closest = state.closest_to(name).expect("a pair");
            assert_eq!(closest.lower_m - closest.padding_m, least, "{name}");
            assert!(closest.pair.contains(&name.to_owned()));
        }
        assert!(state.closest_to("nobody").is_none());
    }
    // Objects by their poses, pushed and set.
    let poses = [at(3.0, 0.0, 1.8), at(1.0, 0.2, 1.9)];
    let mut pushed = ClearanceQuestion::new(["post"], 1.5).with_witnesses();
    poses.iter().for_each(|pose| pushed.push(std::slice::from_ref(pose)));
    pushed.request_mut().cold = true;
    let found = client.clearance("cell", pushed).await.expect("answered");
    let set = client.clearance("cell", ClearanceQuestion::new(["post"], 1.5).with_states(&poses)).await;
    assert_eq!(set.expect("answered").states.len(), 2);
    let numbers = poses.iter().flat_map(|pose| {
        let rotation = pose.rotation().coords;
        pose.translation().iter().chain(rotation.iter()).copied().collect::<Vec<_>>()
    });
    let slots = [scene.slot("post").expect("an object")];
    let own = Clearance::new(scene.clone(), &slots, numbers.collect(), 1.5, false).expect("a question");
    let own = in_process(&scene, own.cold());
    same(&scene, 0, &own, &found);
    assert!(found.states.iter().all(|state| !state.near.is_empty() && state.near[0].gradients.is_some()), "{found:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn questions_that_cannot_be_answered_name_their_field() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let of = |robot: &str, joints: &[&'static str], influence_m: f64, values: &[f64]| {
        ClearanceQuestion::of_robot(robot, joints.iter().copied(), influence_m).with_joint_values(values)
    };
    for (question, field) in [
        (of("one", &[], 0.1, &[0.0]), "joint_values"),
        (of("one", &["elbow"], 0.1, &[0.0]), "joints[0]"),
        (of("one", &[], -0.1, &[0.0, 0.0]), "influence_m"),
        (ClearanceQuestion::new(["post"], 0.1), "poses"),
        (ClearanceQuestion::new(["post", "post"], 0.1).with_states(&[at(0.0, 0.0, 0.0); 2]), "objects[1]"),
    ] {
        let error = client.clearance("cell", question).await.expect_err("refused");
        assert_eq!(error.field().as_deref(), Some(field), "{error}");
    }
    let nobody = client.clearance("cell", of("three", &[], 0.1, &[0.0])).await.expect_err("refused");
    assert!(matches!(&nobody, ClientError::Refused(status) if status.message().contains("three")), "{nobody}");
}
