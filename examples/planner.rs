//! A planner's loop: a scene is made, poses are streamed, a thousand states are checked, and the
//! closest pairs printed. The README shows it.
//!
//! ```text
//! sublevel serve --data sublevel-data &
//! cargo run --release --example planner -- http://127.0.0.1:50051
//! ```

use nalgebra::Vector3;
use sublevel::client::{Client, Question, StatesQuestion};
use sublevel::measure::Pose;
use sublevel::scene::query::{Measure, StateVerdict};

#[tokio::main]
async fn main() -> Result<(), Box<dyn std::error::Error>> {
    let url = std::env::args().nth(1).unwrap_or_else(|| "http://127.0.0.1:50051".into());
    run(&url).await
}

/// The whole loop, against the server at an address; removes the scene in the end.
pub async fn run(url: &str) -> Result<(), Box<dyn std::error::Error>> {
    let client = Client::connect(url).await?;
    let table = client.create_box("table", Vector3::new(0.6, 0.4, 0.02)).await?;
    let finger = client.create_box("finger", Vector3::new(0.01, 0.02, 0.05)).await?;
    client.create_scene("cell").await?;
    let [left, right] = fingers(1.0);
    let objects = [("table", &table, at(0.0, 0.7)), ("left", &finger, left), ("right", &finger, right)];
    client.put_objects("cell", objects).await?;
    // Poses at the rate of a controller.
    let mut stream = client.stream_poses("cell", ["left", "right"]).await?;
    for step in 0..100 {
        stream.send(&fingers(1.0 - 0.001 * f64::from(step))).await?;
    }
    // A thousand states of the way down, in one call.
    let states: Vec<_> = (0..1000).flat_map(|step| fingers(0.9 - 0.0002 * f64::from(step))).collect();
    let question = StatesQuestion::new(["left", "right"]).with_states(&states).with_margin(0.005);
    let checked = client.check_states("cell", question).await?;
    let free = checked.verdicts.iter().take_while(|&&verdict| verdict == StateVerdict::Free).count();
    println!("{free} states are free, then {:?} are nearer than 5 mm", checked.pairs[free]);
    // What is near at the last of them.
    let near = Question::within(0.2).with_poses([("left", states[2 * free - 2]), ("right", states[2 * free - 1])]);
    for row in client.evaluate("cell", near, &[Measure::Distance]).await?.rows {
        println!("{} to {}: between {} m and {} m", row.a, row.b, row.answer.lower, row.answer.upper);
    }
    client.delete_scene("cell").await?;
    Ok(())
}

/// Upright beside the z axis, metres.
fn at(y: f64, z: f64) -> Pose {
    Pose::identity().with_translation(Vector3::new(0.0, y, z))
}

/// Where the left and the right finger of a gripper at that height are, metres.
fn fingers(z: f64) -> [Pose; 2] {
    [at(0.06, z), at(-0.06, z)]
}
