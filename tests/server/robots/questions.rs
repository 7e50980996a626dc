//! States and clearances by joint values, over the wire.

use sublevel::client::{ClearanceQuestion, StatesQuestion};
use sublevel::scene::query::StateVerdict;
use sublevel::scene::{Subject, Update};
use sublevel::service::proto::{CheckStatesRequest, ClearanceRequest, EvaluateRequest, Measure, Verdict};

use super::{at, cell, joints, served};
use crate::harness::{pair, question};

pub(super) fn packed(values: &[f64]) -> bytes::Bytes {
    values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>().into()
}

fn numbers(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks::<8>().0.iter().map(|number| f64::from_le_bytes(*number)).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn states_by_joint_values_with_what_is_held() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    // What the hand holds is 1.3 m from the joint: it meets the ball when the arm points along x.
    let put = |x: f64| Update { poses: vec![("post".into(), at(x, 0.0, 0.3))], ..Update::default() };
    client.update_scene("cell", &put(1.28)).await.expect("moved");
    let quarter = std::f64::consts::FRAC_PI_2;
    let values = [0.0, 0.0, quarter, 0.0, f64::NAN, 0.0, 2.1, 0.0, -quarter, 0.2];
    let ask = || StatesQuestion::of_robot("one", []).with_joint_values(&values);
    let found = client.check_states("cell", ask()).await.expect("answered");
    let (free, contact, invalid) = (StateVerdict::Free, StateVerdict::Contact, StateVerdict::Invalid);
    assert_eq!(found.verdicts, [free, contact, invalid, invalid, free]);
    let pair = found.pairs[1].clone().expect("a pair");
    assert!(pair.contains(&"post".to_owned()), "{pair:?}");
    // Which state is invalid, and why.
    let not_finite = "joint_values[2]: joint lift is NaN; give a finite number";
    let beyond = "joint_values[3]: joint lift is 2.1, outside its limits -2 to 2; give a value within them";
    let reasons: Vec<Option<&str>> = found.reasons.iter().map(Option::as_deref).collect();
    assert_eq!(reasons, [None, None, Some(not_finite), Some(beyond), None]);
    let near = ClearanceQuestion::of_robot("one", [], 0.1).with_joint_values(&values);
    let near = client.clearance("cell", near).await.expect("answered");
    let of_near: Vec<Option<&str>> = near.states.iter().map(|state| state.reason.as_deref()).collect();
    assert_eq!(of_near, reasons);
    let good = [0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 1.0];
    let [mut above, mut long] = [good; 2];
    (above[2], long[6]) = (12.0, 2.0);
    let poses = CheckStatesRequest {
        scene: "cell".into(),
        objects: vec!["held".into(), "post".into()],
        poses: packed([good, above, good, long].as_flattened()),
        ..Default::default()
    };
    let found = clients.queries.check_states(poses).await.expect("answered").into_inner();
    assert_eq!(found.verdicts[..], [Verdict::Free, Verdict::Invalid].map(|verdict| verdict as u8));
    let text = "poses[3]: object \"post\" has no usable pose: rotation is not a unit quaternion: its length deviates \
                by 1.000e0, at most 1e-6 is accepted; normalise it";
    assert_eq!(found.reasons, ["", text]);
    // The same of one joint: the slide is as in the scene.
    let one = StatesQuestion::of_robot("one", ["lift"]).with_joint_values(&[0.0, quarter]);
    let found = client.check_states("cell", one.clone()).await.expect("answered");
    assert_eq!((found.verdicts, found.reasons), (vec![free, contact], vec![None; 2]));
    let raw = CheckStatesRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joint_values: packed(&[0.0; 4]),
        ..Default::default()
    };
    let found = clients.queries.check_states(raw).await.expect("answered").into_inner();
    assert!(found.reasons.is_empty(), "valid states have none: {found:?}");
    // The ball is left out, or the robot is padded.
    let allow = Update {
        allow: vec![
            (Subject::Group("one".into()), Subject::Object("post".into())),
            (Subject::Object("held".into()), Subject::Object("post".into())),
        ],
        ..Update::default()
    };
    client.update_scene("cell", &allow).await.expect("allowed");
    assert_eq!(client.check_states("cell", one.clone()).await.expect("answered").verdicts, [free, free]);
    let padding = Update { group_paddings: vec![("one".into(), Some(2.0))], ..Update::default() };
    client.update_scene("cell", &padding).await.expect("padded");
    let found = client.check_states("cell", one).await.expect("answered");
    assert_eq!(found.verdicts, [contact, contact], "the other robot is within 3 m");
}

#[tokio::test(flavor = "multi_thread")]
async fn clearances_come_with_a_row_for_the_joints() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let step = 1e-6;
    let values = [0.3, 0.1, 0.3 - step, 0.1, 0.3 + step, 0.1, 0.3, 0.1 - step, 0.3, 0.1 + step];
    let request = ClearanceRequest {
        scene: "cell".into(),
        robot: "one".into(),
        joint_values: packed(&values),
        influence_m: 4.0,
        ..Default::default()
    };
    let found = clients.queries.clearance(request.clone()).await.expect("answered").into_inner();
    assert_eq!(&found.checked[..], [1; 5]);
    let offsets: Vec<u32> = found.offsets.as_chunks::<4>().0.iter().map(|n| u32::from_le_bytes(*n)).collect();
    let rows = offsets[1] as usize;
    assert!(rows > 5 && offsets[5] as usize == 5 * rows, "{offsets:?}");
    let (gradients, upper) = (numbers(&found.joint_gradients), numbers(&found.upper_m));
    assert_eq!(gradients.len(), 2 * 5 * rows);
    let mut seen = 0;
    for row in 0..rows {
        for joint in 0..2 {
            let value = |state: usize| upper[state * rows + row];
            let difference = (value(2 + 2 * joint) - value(1 + 2 * joint)) / (2.0 * step);
            let gradient = gradients[2 * row + joint];
            // Where another minimiser is as near there is no derivative.
            if !gradient.is_nan() && found.flags[row] == 0 {
                assert!((difference - gradient).abs() < 1e-3, "{row} {joint}: {difference} {gradient}");
                seen += usize::from(gradient.abs() > 1e-3);
            }
        }
    }
    assert!(seen > 5, "{seen}");
    let without = ClearanceRequest { without_gradients: true, ..request };
    let without = clients.queries.clearance(without).await.expect("answered").into_inner();
    assert!(without.joint_gradients.is_empty() && without.pairs == found.pairs);
}

#[tokio::test(flavor = "multi_thread")]
async fn links_are_objects_for_every_question() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let distance =
        |a: &str, b: &str| EvaluateRequest { scene: "cell".into(), ..question(vec![pair(a, b)], &[Measure::Distance]) };
    let answer = clients.queries.evaluate(distance("two/finger", "post")).await.expect("answered").into_inner();
    // The finger is at z = 0.3 + 1 + 0.2, the ball of 0.05 m at 2.
    assert!((answer.answers[0].upper - (0.5 - 0.05 - 0.02)).abs() < 1e-8, "{:?}", answer.answers[0]);
    client.set_joints("cell", "two", joints(&["slide"], &[0.1])).await.expect("set");
    let answer = clients.queries.evaluate(distance("two/finger", "post")).await.expect("answered").into_inner();
    assert!((answer.answers[0].upper - (0.35 - 0.05 - 0.02)).abs() < 1e-8, "the finger follows by half of it again");
}
