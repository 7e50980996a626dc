//! A planner with a robot of seven joints, such as a Panda: it is loaded from its files and placed,
//! a path is checked, its edges are proven free, and the closest links are printed. Then the
//! certificate of the path is kept, and a state that is in contact is explained.
//!
//! ```text
//! sublevel serve --data sublevel-data &
//! cargo run --release --example robot -- http://127.0.0.1:50051 panda.urdf panda.srdf
//! ```

use std::error::Error;
use std::path::Path;

use nalgebra::Vector3;
use sublevel::client::{
    CertificateQuestion, ClearanceQuestion, Client, ExplainQuestion, MotionsQuestion, RobotFiles, RobotPlacement,
    StatesQuestion,
};
use sublevel::measure::Pose;

/// From one side of a wall over it to the other, radians.
pub const PATH: [[f64; 7]; 4] = [
    [-0.7, 0.2, 0.0, -1.9, 0.0, 2.1, 0.8],
    [-0.7, -0.3, 0.0, -1.5, 0.0, 1.9, 0.8],
    [0.7, -0.3, 0.0, -1.5, 0.0, 1.9, 0.8],
    [0.7, 0.2, 0.0, -1.9, 0.0, 2.1, 0.8],
];

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [url, urdf, srdf] = &arguments[..] else {
        return Err(
            "give the address of a server, a URDF and an SRDF: http://127.0.0.1:50051 panda.urdf panda.srdf".into()
        );
    };
    run(url, urdf.as_ref(), srdf.as_ref()).await
}

/// All of it, against the server at an address.
pub async fn run(url: &str, urdf: &Path, srdf: &Path) -> Result<(), Box<dyn Error>> {
    let scene = &format!("robot-{}", std::process::id());
    let is_free = plan(url, (urdf, srdf), scene, &PATH).await?;
    println!("the path is {}", if is_free { "proven free" } else { "not free" });
    let client = Client::connect(url).await?;
    keep(&client, scene, &PATH).await?;
    explain(&client, scene, &PATH).await?;
    client.delete_scene(scene).await?;
    Ok(())
}

/// The planner: whether a path is free.
pub async fn plan(
    url: &str,
    (urdf, srdf): (&Path, &Path),
    scene: &str,
    path: &[[f64; 7]],
) -> Result<bool, Box<dyn Error>> {
    let client = Client::connect(url).await?;
    let robot = client.load_robot_files(&RobotFiles::new(urdf).with_srdf(srdf)).await?;
    let wall = client.create_box("wall", Vector3::new(0.15, 0.03, 0.22)).await?;
    client.create_scene(scene).await?;
    client.put_objects(scene, [("wall", &wall, at(0.6, 0.0, 0.22))]).await?;
    client.place_robot(scene, &RobotPlacement::new("arm", &robot)).await?;

    let states = client.check_states(scene, StatesQuestion::of_robot("arm", []).with_configurations(path)).await?;
    let edges = client.check_motions(scene, MotionsQuestion::of_robot("arm", []).with_edges(path)).await?;
    let near = client.clearance(scene, ClearanceQuestion::of_robot("arm", [], 0.5).with_configurations(path)).await?;
    println!("states {:?}, edges {:?}", states.verdicts, edges.verdicts());
    for pair in near.states.iter().filter_map(|state| state.closest_to("wall")) {
        println!("{} and {} are {:.4} m apart", pair.pair[0], pair.pair[1], pair.lower_m);
    }
    Ok(edges.are_free())
}

/// The certificate of a path goes with the plan; the controller checks it against the scene at that
/// time.
async fn keep(client: &Client, scene: &str, path: &[[f64; 7]]) -> Result<(), Box<dyn Error>> {
    let question = MotionsQuestion::of_robot("arm", []).with_path(path.iter().map(|state| &state[..]));
    let checked = client.check_motions(scene, question.with_certificates()).await?;
    if let Some(certificate) = checked.motions[0].certificate.clone() {
        let question = CertificateQuestion::new(certificate).of_robot(scene, "arm");
        match client.verify_motion(question).await?.proof {
            Ok(proven) => println!("the certificate holds, with {:.4} m to spare", proven.clearance_lower_m),
            Err(reason) => println!("the certificate does not hold: {reason}"),
        }
    }
    Ok(())
}

/// The straight way from start to goal goes through the wall: how far it is free, and why no
/// farther.
async fn explain(client: &Client, scene: &str, path: &[[f64; 7]]) -> Result<(), Box<dyn Error>> {
    let (start, goal) = (path[0], path[path.len() - 1]);
    let mut question = MotionsQuestion::of_robot("arm", []).with_edges(&[start, goal]);
    question.request_mut().first_contact = true;
    let straight = &client.check_motions(scene, question).await?.motions[0];
    println!("straight on: {:?}, free up to {:.4} of the way", straight.verdict, straight.alpha);

    let halfway: Vec<f64> = start.iter().zip(goal).map(|(start, goal)| 0.5 * (start + goal)).collect();
    let found = client.explain(scene, ExplainQuestion::of_robot("arm", []).with_joint_values(&halfway)).await?;
    for pair in found.pairs.iter().filter(|pair| pair.is_contact) {
        println!("halfway {} and {} overlap by {:.1} mm", pair.pair[0], pair.pair[1], -1e3 * pair.upper_m);
    }
    Ok(())
}

/// Upright at a place, metres.
fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::identity().with_translation(Vector3::new(x, y, z))
}
