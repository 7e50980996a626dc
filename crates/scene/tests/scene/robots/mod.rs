//! Robots in scenes: links as objects, updates, states by joint values.

mod derived;
mod explanations;
mod motions;
mod refusals;
mod rules;
mod states;
mod updates;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock};

use sublevel_core::body::Body;
use sublevel_core::measure::Pose;
use sublevel_robot::{read_srdf, read_urdf};
use sublevel_scene::{
    Attachment, Geometry, NamedJointValues, PlaceRobot, Placement, Robot, RobotId, Scene, SceneError, Slot, Subject,
    Update,
};
use sublevel_testkit::random::at;

use crate::worlds::{lookup, placement};

/// An arm with links of every primitive: `base`, `upper` on a joint that turns about y, `fore` and
/// `wrist` behind a frame, a slide, and a finger that mimics it.
pub(crate) const ARM: &str = r#"<robot name="arm">
  <link name="base"><collision><geometry><box size="0.3 0.3 0.2"/></geometry></collision></link>
  <link name="upper"><collision>
    <origin xyz="0 0 0.25" rpy="0 0 0"/><geometry><cylinder radius="0.05" length="0.4"/></geometry>
  </collision></link>
  <link name="elbow"/>
  <link name="fore">
    <collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.04" length="0.3"/></geometry></collision>
    <collision><geometry><sphere radius="0.06"/></geometry></collision>
  </link>
  <link name="wrist"><collision>
    <origin xyz="0.02 0 0.05" rpy="0 1.2 0"/><geometry><sphere radius="0.05"/></geometry>
  </collision></link>
  <link name="finger"><collision><geometry><box size="0.02 0.02 0.08"/></geometry></collision></link>
  <link name="tip"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.1"/><axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="fixed" type="fixed"><parent link="upper"/><child link="elbow"/><origin xyz="0 0 0.5"/></joint>
  <joint name="bend" type="revolute"><parent link="elbow"/><child link="fore"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="spin" type="continuous"><parent link="fore"/><child link="wrist"/>
    <origin xyz="0 0 0.4"/><axis xyz="0 0 1"/></joint>
  <joint name="slide" type="prismatic"><parent link="wrist"/><child link="finger"/>
    <origin xyz="0 0 0.12"/><axis xyz="1 0 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/></joint>
  <joint name="follow" type="prismatic"><parent link="wrist"/><child link="tip"/>
    <axis xyz="-1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/><mimic joint="slide" multiplier="2"/></joint>
</robot>"#;

/// The arm with pairs of links that an SRDF disables; each made once, as its bodies take long.
pub(crate) fn robot(disabled: &[(&str, &str)]) -> Arc<Robot> {
    static MADE: Mutex<BTreeMap<String, Arc<Robot>>> = Mutex::new(BTreeMap::new());
    let mut made = MADE.lock().expect("nothing fails in here");
    made.entry(format!("{disabled:?}")).or_insert_with(|| robot_with(disabled, &BTreeMap::new())).clone()
}

pub(crate) fn robot_with(disabled: &[(&str, &str)], bodies: &BTreeMap<Arc<str>, Geometry>) -> Arc<Robot> {
    let pairs: String = disabled
        .iter()
        .map(|(a, b)| format!("<disable_collisions link1=\"{a}\" link2=\"{b}\" reason=\"Never\"/>"))
        .collect();
    let srdf = format!("<robot name=\"arm\">{pairs}</robot>");
    let description = read_urdf(ARM).expect("a robot");
    let semantics = read_srdf(&srdf, &description).expect("semantics");
    let ids = bodies.iter().map(|(link, body)| (&**link, body.id()));
    let id = RobotId::of(ARM, &srdf, ids);
    Arc::new(Robot::new(id, &description, &semantics, bodies).expect("a robot"))
}

pub(crate) fn values(joints: &[&str], values: &[f64]) -> NamedJointValues {
    NamedJointValues { joints: joints.iter().map(|&name| name.into()).collect(), values: values.to_vec() }
}

pub(crate) fn place(name: &str, robot: &Arc<Robot>, base: Pose) -> PlaceRobot {
    PlaceRobot { name: name.into(), robot: robot.clone(), base, joints: NamedJointValues::default() }
}

pub(crate) fn set(robot: &str, named: NamedJointValues) -> Update {
    Update { joints: vec![(robot.into(), named)], ..Update::default() }
}

/// A ball and a box to put around.
pub(crate) fn things() -> [Geometry; 2] {
    static THINGS: OnceLock<[Geometry; 2]> = OnceLock::new();
    let make = || {
        let ball = Body::ball("ball", nalgebra::Vector3::zeros(), 0.1).expect("a ball").with_gap(0.0);
        let cuboid = Body::cuboid("box", nalgebra::Vector3::new(0.1, 0.2, 0.05)).expect("a box").with_gap(0.0);
        [ball.into(), cuboid.into()]
    };
    THINGS.get_or_init(make).clone()
}

pub(crate) fn apply(scene: &Scene, update: &Update) -> Result<Scene, SceneError> {
    scene.updated(update, lookup(&things()))
}

pub(crate) fn applied(scene: &Scene, update: &Update) -> Scene {
    apply(scene, update).expect("an update")
}

/// The arm at 1 m along x, a ball far away and a box held by the wrist.
pub(crate) fn cell(disabled: &[(&str, &str)]) -> Scene {
    let [ball, cuboid] = things();
    let mut update = Update { robots: vec![place("arm", &robot(disabled), at(1.0, 0.0, 0.0))], ..Update::default() };
    let attachment = Attachment {
        to: "arm/wrist".into(),
        pose: at(0.0, 0.0, 0.35),
        touch: vec![Subject::Object("arm/finger".into())],
    };
    let tool = placement("tool", &cuboid, at(0.0, 0.0, 0.0));
    let tool = Placement { pose: None, attachment: Some(attachment), ..tool };
    update.upserts = vec![placement("ball", &ball, at(5.0, 0.0, 0.0)), tool];
    applied(&Scene::new("cell", 0).expect("a name"), &update)
}

pub(crate) fn slot(scene: &Scene, name: &str) -> Slot {
    scene.slot(name).unwrap_or_else(|| panic!("no object {name}"))
}

pub(crate) fn pose(scene: &Scene, name: &str) -> Pose {
    *scene.pose(slot(scene, name)).expect("a pose")
}

/// How far two poses differ: metres plus radians.
pub(crate) fn apart(a: &Pose, b: &Pose) -> f64 {
    (a.translation() - b.translation()).norm() + a.rotation().angle_to(b.rotation())
}
