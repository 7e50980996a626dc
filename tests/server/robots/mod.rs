//! Robots: loaded, placed in scenes, asked about, kept.

mod clearances;
#[cfg(feature = "fit")]
mod command;
#[cfg(feature = "fit")]
mod derived_jobs;
mod explained;
#[cfg(feature = "fit")]
mod files;
mod group_states;
mod kept;
mod meshes;
mod motions;
mod motions_refused;
#[cfg(feature = "fit")]
mod panda;
mod pictures;
mod questions;
mod refused;
mod witnesses;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;
use sublevel::client::{Client, RobotPlacement, StoredRobot};
use sublevel::measure::Pose;
use sublevel::scene::{Attach, NamedJointValues, Subject, Update};
use sublevel::store::RobotSource;

use crate::harness::{Clients, Running, ball};

/// A post, an arm that turns about y, and a hand with a mesh on a slide that a finger mimics.
const URDF: &str = r#"<robot name="crane">
  <link name="post"><collision><geometry><box size="0.2 0.2 0.4"/></geometry></collision></link>
  <link name="arm"><collision>
    <origin xyz="0 0 0.5"/><geometry><capsule radius="0.05" length="0.6"/></geometry>
  </collision></link>
  <link name="flange"/>
  <link name="hand"><collision><geometry><mesh filename="hand.stl"/></geometry></collision></link>
  <link name="finger"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
  <joint name="lift" type="revolute"><parent link="post"/><child link="arm"/>
    <origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="end" type="fixed"><parent link="arm"/><child link="flange"/><origin xyz="0 0 1"/></joint>
  <joint name="slide" type="prismatic"><parent link="flange"/><child link="hand"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="0.2" effort="1" velocity="1"/></joint>
  <joint name="grip" type="prismatic"><parent link="hand"/><child link="finger"/>
    <origin xyz="0 0 0.2"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>
    <mimic joint="slide" multiplier="0.5"/></joint>
</robot>"#;

const SRDF: &str = r#"<robot name="crane">
  <group name="all"><chain base_link="post" tip_link="finger"/></group>
  <disable_collisions link1="post" link2="hand" reason="Never"/>
</robot>"#;

/// An SRDF of the same robot with what is odd and does not prevent its use.
const ODD_SRDF: &str = r#"<robot name="crane">
  <group name="empty"/>
  <disable_collisions link1="post" link2="hand" reason="Never"/>
  <disable_collisions link1="hand" link2="post"/>
  <something/>
</robot>"#;

/// What is said of it, in the order of its lines.
const ODD: [&str; 3] = [
    "line 2, column 3, robot/group[empty]: the group is empty",
    "line 4, column 3, robot/disable_collisions[2]: the pair \"post\", \"hand\" is disabled more than once",
    "line 5, column 3, robot/something: the element \"something\" is not read",
];

/// A cube with edges of 0.1 m, as OFF.
pub(crate) const CUBE: &str = "OFF\n8 12 0\n0 0 0\n0.1 0 0\n0.1 0.1 0\n0 0.1 0\n0 0 0.1\n0.1 0 0.1\n0.1 0.1 0.1\n0 0.1 0.1\n\
3 0 2 1\n3 0 3 2\n3 4 5 6\n3 4 6 7\n3 0 1 5\n3 0 5 4\n3 1 2 6\n3 1 6 5\n3 2 3 7\n3 2 7 6\n3 3 0 4\n3 3 4 7\n";

/// A server with the robot, and what its hand is made of.
async fn served(dir: &Path) -> (Running, Client, Clients, StoredRobot) {
    let server = Running::start(dir);
    let (client, mut clients) = (server.client().await, server.connect().await);
    let id = clients.put(&ball(0.1)).await;
    let robot = client.load_robot(&source(&id)).await.expect("a robot");
    (server, client, clients, robot)
}

fn source(hand: &str) -> RobotSource {
    let bodies = BTreeMap::from([("hand".into(), hand.parse().expect("an id"))]);
    RobotSource { urdf: URDF.into(), srdf: SRDF.into(), bodies }
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::from_quaternion(Vector3::new(x, y, z), [0.0, 0.0, 0.0, 1.0]).expect("a pose")
}

fn joints(names: &[&str], values: &[f64]) -> NamedJointValues {
    NamedJointValues { joints: names.iter().map(|&name| name.into()).collect(), values: values.to_vec() }
}

fn placement(robot: &StoredRobot, name: &str, x: f64) -> RobotPlacement {
    RobotPlacement { name: name.into(), robot: robot.id, base: at(x, 0.0, 0.0), joints: NamedJointValues::default() }
}

/// A scene with two robots, a ball that the hand of one holds, and one that stands above the other.
async fn cell(client: &Client, robot: &StoredRobot) {
    client.create_scene("cell").await.expect("made");
    let thing = client.create_ball("thing", 0.05).await.expect("a ball");
    client.place_robot("cell", &placement(robot, "one", 0.0)).await.expect("placed");
    client.place_robot("cell", &placement(robot, "two", 3.0)).await.expect("placed");
    let objects = [("held", &thing, at(0.0, 0.0, 0.0)), ("post", &thing, at(3.0, 0.0, 2.0))];
    client.put_objects("cell", objects).await.expect("placed");
    let attach = Attach {
        name: "held".into(),
        to: "one/hand".into(),
        pose: Some(at(0.0, 0.0, 0.3)),
        touch: vec![Subject::Object("one/finger".into())],
    };
    let update = Update { attach: vec![attach], ..Update::default() };
    client.update_scene("cell", &update).await.expect("held");
}
