//! A planner with a robot: it is loaded and placed, a path is checked, its edges are proven free,
//! the certificate of one is kept, and the closest links are printed.
//!
//! ```text
//! sublevel serve --data sublevel-data &
//! cargo run --release --example robot -- http://127.0.0.1:50051
//! ```

use nalgebra::{UnitQuaternion, Vector3};
use sublevel::client::{BodySource, Client, MotionsQuestion, Question, RobotPlacement, StatesQuestion};
use sublevel::measure::Pose;
use sublevel::scene::NamedJointValues;
use sublevel::scene::query::Measure;
use sublevel::service::proto::VerifyMotionRequest;
use sublevel::store::RobotSource;

/// An arm of two links on a turning post; boxes, capsules and spheres need no fits.
const ARM: &str = r#"<robot name="arm">
  <link name="post"><collision>
    <origin xyz="0 0 0.2"/><geometry><box size="0.2 0.2 0.4"/></geometry></collision></link>
  <link name="shoulder"/>
  <link name="upper"><collision>
    <origin xyz="0 0 0.3"/><geometry><capsule radius="0.05" length="0.4"/></geometry></collision></link>
  <link name="lower"><collision>
    <origin xyz="0 0 0.3"/><geometry><capsule radius="0.04" length="0.4"/></geometry></collision></link>
  <link name="hand"><collision><geometry><sphere radius="0.06"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="post"/><child link="shoulder"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="lift" type="revolute"><parent link="shoulder"/><child link="upper"/>
    <axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="bend" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.6"/><axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>
  <joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/><origin xyz="0 0 0.65"/></joint>
</robot>"#;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let url = std::env::args().nth(1).unwrap_or_else(|| "http://127.0.0.1:50051".into());
    run(&url).await
}

/// All of it, against the server at an address.
pub async fn run(url: &str) -> Result<(), Box<dyn std::error::Error>> {
    let client = Client::connect(url).await?;
    let robot = client.load_robot(&RobotSource { urdf: ARM.into(), ..RobotSource::default() }).await?;
    println!("robot {} takes {} joint values", robot.name, robot.joints.len());

    // A floor, and a pole on the way.
    let scene = format!("robot-{}", std::process::id());
    client.create_scene(&scene).await?;
    let floor = BodySource::HalfSpace { normal: Vector3::z(), offset: 0.0 };
    let floor = client.create_body("floor", floor).await?.id;
    let pole = client.create_body("pole", BodySource::Cylinder { radius: 0.05, half_height: 0.75 }).await?.id;
    client
        .put_objects(&scene, [("floor", &floor, at(0.0, 0.0, -0.001)?), ("pole", &pole, at(0.6, 0.6, 0.75)?)])
        .await?;
    let joints = NamedJointValues::default();
    client
        .place_robot(&scene, &RobotPlacement { name: "arm".into(), robot: robot.id, base: at(0.0, 0.0, 0.0)?, joints })
        .await?;

    // From one side of the pole to the other: straight through it, or over it.
    let (start, goal) = ([0.0, 1.2, 0.5], [1.6, 1.2, 0.5]);
    let over = [[0.0, 0.0, 0.5], [1.6, 0.0, 0.5]];
    let states = StatesQuestion::of_robot("arm", []).with_joint_values(&[start, goal].concat());
    println!("start and goal: {:?}", client.check_states(&scene, states).await?.verdicts);

    let question = MotionsQuestion::of_robot("arm", []).with_path([&start[..], &goal]);
    let mut question = question.with_path([&start[..], &over[0], &over[1], &goal]).with_certificates();
    question.request_mut().first_contact = true;
    question.request_mut().clearance_accuracy_m = Some(1e-3);
    let checked = client.check_motions(&scene, question).await?;
    for motion in &checked.motions {
        let verdict = motion.verdict;
        if let Some(([a, b], s)) = &motion.contact {
            println!("{verdict:?}: free up to {:.4}, {a} and {b} touch before {s:.4}", motion.alpha);
        } else {
            println!("{verdict:?}: nothing comes nearer than {:.3} m", motion.clearance_lower_m);
        }
    }

    // The certificate goes with the plan; the controller checks it against the scene at that time.
    if let Some(certificate) = checked.motions[1].certificate.clone() {
        let request =
            VerifyMotionRequest { certificate, scene: scene.clone(), robot: "arm".into(), ..Default::default() };
        println!("the certificate holds: {}", client.verify_motion(request).await?.holds);
    }

    // Where the arm has least room, on the way over the pole.
    client.set_joints(&scene, "arm", NamedJointValues { joints: Vec::new(), values: vec![0.8, 0.0, 0.5] }).await?;
    for row in client.evaluate(&scene, Question::within(0.3), &[Measure::Distance]).await?.rows {
        println!("{} to {}: between {:.6} m and {:.6} m", row.a, row.b, row.answer.lower, row.answer.upper);
    }
    client.delete_scene(&scene).await?;
    client.delete_robot(&robot.id).await?;
    Ok(())
}

/// Upright at a place, metres.
fn at(x: f64, y: f64, z: f64) -> Result<Pose, Box<dyn std::error::Error>> {
    Ok(Pose::from_quaternion(Vector3::new(x, y, z), UnitQuaternion::identity().coords.into())?)
}
