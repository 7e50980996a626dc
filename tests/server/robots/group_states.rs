//! Named states of the groups of an SRDF, and questions that take them as they come.

use sublevel::client::{StatesQuestion, StoredGroupState};
use sublevel::scene::Update;
use sublevel::scene::query::StateVerdict;
use sublevel::service::proto::{CheckStatesRequest, GetRobotRequest, JointValues, RobotGroupState, Verdict};
use sublevel::store::RobotSource;

use super::questions::packed;
use super::{at, cell, joints, served, source};
use crate::harness::Running;

/// An SRDF of the crane whose states set joints in another order than that of joint vectors, a
/// joint that follows another one, and a virtual joint.
pub(super) const STATES: &str = r#"<robot name="crane">
  <virtual_joint name="rail" type="planar" parent_frame="floor" child_link="post"/>
  <group name="all"><chain base_link="post" tip_link="finger"/></group>
  <group name="tip"><joint name="slide"/><joint name="grip"/></group>
  <group name="base"><joint name="rail"/></group>
  <group_state name="home" group="all">
    <joint name="slide" value="0.125"/><joint name="lift" value="-1.25"/>
  </group_state>
  <group_state name="reach" group="all"><joint name="lift" value="1.5"/><joint name="slide" value="0.1"/></group_state>
  <group_state name="home" group="tip"><joint name="grip" value="0.05"/><joint name="slide" value="0.2"/></group_state>
  <group_state name="home" group="base"><joint name="rail" value="1 2 0.5"/></group_state>
  <disable_collisions link1="post" link2="hand" reason="Never"/>
</robot>"#;

/// Name and group of each, and the joints with values of their own, radians or metres, in the order
/// of joint vectors.
const EXPECTED: [(&str, &str, &[&str], &[f64]); 4] = [
    ("home", "all", &["lift", "slide"], &[-1.25, 0.125]),
    ("reach", "all", &["lift", "slide"], &[1.5, 0.1]),
    ("home", "tip", &["slide"], &[0.2]),
    ("home", "base", &[], &[]),
];

#[tokio::test(flavor = "multi_thread")]
async fn states_of_groups_come_with_the_robot_and_are_checked_and_set_as_they_are() {
    let dir = tempfile::tempdir().expect("a directory");
    let (server, client, mut clients, robot) = served(dir.path()).await;
    assert_eq!(robot.group_states, [], "its SRDF has none");
    let hand = robot.links[3].body.expect("a body").to_string();
    let robot = client.load_robot(&RobotSource { srdf: STATES.into(), ..source(&hand) }).await.expect("loaded");
    assert_eq!(robot.warnings, [""; 0]);
    let stored = EXPECTED.map(|(name, group, names, values)| StoredGroupState {
        name: name.into(),
        group: group.into(),
        joints: joints(names, values),
    });
    assert_eq!(robot.group_states, stored);
    let request = GetRobotRequest { id: robot.id.to_string() };
    let found = clients.robots.get_robot(request).await.expect("there").into_inner().robot.expect("a robot");
    let sent = EXPECTED.map(|(name, group, names, values)| RobotGroupState {
        name: name.into(),
        group: group.into(),
        joints: Some(JointValues {
            joints: names.iter().map(ToString::to_string).collect(),
            values: packed(values),
            rows: Vec::new(),
        }),
    });
    assert_eq!(found.group_states, sent);

    // What the hand holds is 1.4 m from the joint of the arm when it reaches, the ball beside it.
    cell(&client, &robot).await;
    let put = Update { poses: vec![("post".into(), at(1.38, 0.0, 0.4))], ..Update::default() };
    client.update_scene("cell", &put).await.expect("moved");
    let (free, contact) = ((StateVerdict::Free, Verdict::Free), (StateVerdict::Contact, Verdict::Contact));
    let states = robot.group_states.iter().zip(&found.group_states);
    for ((state, sent), (verdict, byte)) in states.zip([free, contact, free]) {
        let question = StatesQuestion::of_robot("one", state.joint_names()).with_joint_values(&state.joints.values);
        let checked = client.check_states("cell", question).await.expect("answered");
        assert_eq!(checked.verdicts, [verdict], "{state:?}");
        let JointValues { joints, values, .. } = sent.joints.clone().expect("values");
        let request = CheckStatesRequest {
            scene: "cell".into(),
            robot: "one".into(),
            joints,
            joint_values: values,
            ..Default::default()
        };
        let checked = clients.queries.check_states(request).await.expect("answered").into_inner();
        assert_eq!(checked.verdicts[..], [byte as u8], "{state:?}");
    }
    client.set_joints("cell", "one", robot.group_states[0].joints.clone()).await.expect("set");
    let scene = clients.scene("cell").await;
    let one = scene.robots.iter().find(|robot| robot.name == "one").expect("a robot");
    assert_eq!(one.joints.as_ref().expect("values").values, packed(&[-1.25, 0.125]));

    server.kill();
    let server = Running::start(dir.path());
    let kept = server.client().await.robot(&robot.id).await.expect("there");
    assert_eq!(kept.group_states, stored);
}
