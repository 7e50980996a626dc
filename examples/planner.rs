//! A planner's loop: a scene is made, poses are streamed, a thousand states are checked, and the
//! closest pairs printed.
//!
//! ```text
//! sublevel serve --data sublevel-data &
//! cargo run --release --example planner -- http://127.0.0.1:50051
//! ```

use nalgebra::{UnitQuaternion, Vector3};
use sublevel::client::{BodySource, Client, Question, StatesQuestion};
use sublevel::measure::Pose;
use sublevel::scene::query::Measure;
use sublevel::service::proto::Verdict;

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let url = std::env::args().nth(1).unwrap_or_else(|| "http://127.0.0.1:50051".into());
    run(&url).await
}

/// The whole loop, against the server at an address.
pub async fn run(url: &str) -> Result<(), Box<dyn std::error::Error>> {
    let client = Client::connect(url).await?;
    let info = client.server_info().await?;
    println!("sublevel {} at {url}, {} threads, {}", info.version, info.solver_threads, info.simd_level);

    // A table, a floor, a can, and a gripper of two fingers, all exact.
    let table = client.create_box("table", Vector3::new(0.6, 0.4, 0.02)).await?;
    let finger = client.create_box("finger", Vector3::new(0.01, 0.02, 0.05)).await?;
    let can = client.create_body("can", BodySource::Cylinder { radius: 0.04, half_height: 0.06 }).await?.id;
    let floor = BodySource::HalfSpace { normal: Vector3::z(), offset: 0.0 };
    let floor = client.create_body("floor", floor).await?.id;
    let scene = format!("planner-{}", std::process::id());
    client.create_scene(&scene).await?;
    let objects = [
        ("floor", &floor, at(0.0, 0.0, 0.0)?),
        ("table", &table, at(0.0, 0.0, 0.7)?),
        ("can", &can, at(0.2, 0.0, 0.785)?),
        ("left", &finger, at(0.0, 0.06, 1.0)?),
        ("right", &finger, at(0.0, -0.06, 1.0)?),
    ];
    client.put_objects(&scene, objects).await?;

    // The gripper moves at the rate of its controller.
    let mut stream = client.stream_poses(&scene, ["left", "right"]).await?;
    let mut sent = 0;
    for step in 0..100 {
        let x = 0.001 * f64::from(step);
        sent = stream.send(&[at(x, 0.06, 0.9)?, at(x, -0.06, 0.9)?]).await?;
    }
    while let Some(said) = stream.next().await? {
        if said.sequence == sent {
            println!("100 poses streamed, the scene is at revision {}", said.revision);
            break;
        }
    }

    // A thousand states of a descent onto the can, in one call.
    let descent = |k: i32| 1.0 - 0.0003 * f64::from(k);
    let mut poses = Vec::new();
    for k in 0..1000 {
        poses.extend([at(0.2, 0.06, descent(k))?, at(0.2, -0.06, descent(k))?]);
    }
    let question = StatesQuestion::new(["left", "right"]).with_states(&poses).with_margin(0.005);
    let checked = client.check_states(&scene, question).await?;
    let free = checked.verdicts.iter().take_while(|&&verdict| verdict == Verdict::Free).count();
    let pair = checked.pairs.get(free).cloned().flatten();
    println!(
        "{free} of {} states are free; then {}",
        checked.verdicts.len(),
        match &pair {
            Some([a, b]) => format!("{a} is nearer than 5 mm to {b}"),
            None => "nothing".into(),
        }
    );

    // What is near at the last free state.
    let last = i32::try_from(free)? - 1;
    let there = [("left", at(0.2, 0.06, descent(last))?), ("right", at(0.2, -0.06, descent(last))?)];
    let question = Question::within(0.05).with_poses(there).with_objects(["left", "right"]);
    for row in client.evaluate(&scene, question, &[Measure::Distance]).await?.rows {
        println!("{} to {}: between {:.6} m and {:.6} m", row.a, row.b, row.answer.lower, row.answer.upper);
    }
    client.delete_scene(&scene).await?;
    Ok(())
}

/// Upright at a place, metres.
fn at(x: f64, y: f64, z: f64) -> Result<Pose, Box<dyn std::error::Error>> {
    Ok(Pose::from_quaternion(Vector3::new(x, y, z), UnitQuaternion::identity().coords.into())?)
}
