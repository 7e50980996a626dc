//! The chair swept through the human, over gRPC against a real server.

use super::error::DemoError;
use crate::service::proto::body_service_client::BodyServiceClient;
use crate::service::proto::query_service_client::QueryServiceClient;
use crate::service::proto::scene_service_client::SceneServiceClient;
use crate::service::proto::{
    CreateBodyRequest, CreateSceneRequest, EvaluateRequest, Measure, Object, ObjectPair, ObjectPose, Pose, Quaternion,
    UpdateSceneRequest, Vector3, evaluate_result::Outcome,
};
use crate::service::{ServeOptions, Server};
use std::fmt::Display;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::time::{Duration, Instant};

/// The chair goes from `-REACH` to `REACH` along x, metres; the human stands at the origin and
/// faces `+x`.
const REACH: f64 = 0.9;
const STEPS: usize = 61;
const SCENE: &str = "demo";
const CHAIR: &str = "chair";
const HUMAN: &str = "human";

/// An answer with its proven bracket.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    pub(super) value: f64,
    pub(super) lower: f64,
    pub(super) upper: f64,
}

/// The answers at one position of the chair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// Position of the chair along x, m.
    pub(super) x: f64,
    /// Euclidean distance, m.
    pub(super) distance: Answer,
    /// d(chair‖human).
    pub(super) chair_on_human: Answer,
    /// d(human‖chair).
    pub(super) human_on_chair: Answer,
}

/// A finished sweep.
#[derive(Debug)]
pub(super) struct Sweep {
    pub(super) samples: Vec<Sample>,
    /// Revision of the scene after the last step.
    pub(super) revision: u64,
    /// Time of all updates and answers, network and disk included.
    pub(super) elapsed: Duration,
}

/// Starts a server with an empty catalogue, stores both bodies, sweeps, and stops the server.
pub(super) fn run(chair: &Path, human: &Path) -> Result<Sweep, DemoError> {
    // Goes away with the demo, also when it fails.
    let data = tempfile::Builder::new().prefix("sublevel-demo-").tempdir().map_err(|error| DemoError::Server {
        step: "making a folder for the server's data",
        why: format!("{error}; set TMPDIR to a folder that can be written"),
    })?;
    let step = "starting the server";
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build().map_err(failed(step))?;
    let result = runtime.block_on(async {
        let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let server = Server::bind(ServeOptions { listen, data: data.path().to_owned() }).await.map_err(failed(step))?;
        let url = format!("http://{}", server.local_addr());
        let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
        let serving = tokio::spawn(server.run(async {
            let _ = stopped.await;
        }));
        let result = talk(&url, chair, human).await;
        let _ = stop.send(());
        let step = "stopping the server";
        serving.await.map_err(failed(step))?.map_err(failed(step))?;
        result
    });
    runtime.shutdown_timeout(Duration::from_secs(1));
    result
}

/// The client's side.
async fn talk(url: &str, chair: &Path, human: &Path) -> Result<Sweep, DemoError> {
    let mut bodies = BodyServiceClient::connect(url.to_owned()).await.map_err(failed("connecting"))?;
    let mut objects = Vec::new();
    for (name, file, x) in [(CHAIR, chair, -REACH), (HUMAN, human, 0.0)] {
        let json = std::fs::read(file).map_err(|source| DemoError::File { path: file.into(), source })?;
        let request = CreateBodyRequest { body_file_json: json.into() };
        let response = bodies.create_body(request).await.map_err(failed("storing a body"))?.into_inner();
        let body_id = response.body.ok_or("the reply holds no body").map_err(failed("storing a body"))?.id;
        objects.push(Object { name: name.into(), body_id, pose: Some(at(x)), group: String::new() });
    }

    let mut scenes = SceneServiceClient::connect(url.to_owned()).await.map_err(failed("connecting"))?;
    scenes.create_scene(CreateSceneRequest { name: SCENE.into() }).await.map_err(failed("creating the scene"))?;
    let update = UpdateSceneRequest { name: SCENE.into(), upsert_objects: objects, ..Default::default() };
    scenes.update_scene(update).await.map_err(failed("placing the objects"))?;

    let mut queries = QueryServiceClient::connect(url.to_owned()).await.map_err(failed("connecting"))?;
    let question = EvaluateRequest {
        scene: SCENE.into(),
        pairs: vec![ObjectPair { a: CHAIR.into(), b: HUMAN.into() }],
        measures: [Measure::Distance, Measure::LevelDistanceAOnB, Measure::LevelDistanceBOnA].map(i32::from).to_vec(),
        ..Default::default()
    };
    let mut sweep = Sweep { samples: Vec::with_capacity(STEPS), revision: 0, elapsed: Duration::ZERO };
    let start = Instant::now();
    for step in 0..STEPS {
        let x = REACH * (2.0 * step as f64 / (STEPS - 1) as f64 - 1.0);
        let set_poses = vec![ObjectPose { name: CHAIR.into(), pose: Some(at(x)) }];
        let update = UpdateSceneRequest { name: SCENE.into(), set_poses, ..Default::default() };
        sweep.revision = scenes.update_scene(update).await.map_err(failed("moving the chair"))?.into_inner().revision;
        let answers = queries.evaluate(question.clone()).await.map_err(failed("asking for distances"))?.into_inner();
        let outcomes: Vec<_> = answers.results.into_iter().filter_map(|result| result.outcome).collect();
        let sample = sample(x, &outcomes).ok_or("the reply does not answer what was asked");
        sweep.samples.push(sample.map_err(failed("asking for distances"))?);
    }
    sweep.elapsed = start.elapsed();
    Ok(sweep)
}

/// Upright at `x` metres.
fn at(x: f64) -> Pose {
    Pose {
        translation_m: Some(Vector3 { x, y: 0.0, z: 0.0 }),
        rotation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
    }
}

/// The three outcomes in the order asked for.
fn sample(x: f64, outcomes: &[Outcome]) -> Option<Sample> {
    let [Outcome::Distance(d), Outcome::LevelDistanceAOnB(ab), Outcome::LevelDistanceBOnA(ba)] = outcomes else {
        return None;
    };
    Some(Sample {
        x,
        distance: Answer { value: d.value_m, lower: d.lower_m, upper: d.upper_m },
        chair_on_human: Answer { value: ab.value, lower: ab.lower, upper: ab.upper },
        human_on_chair: Answer { value: ba.value, lower: ba.lower, upper: ba.upper },
    })
}

fn failed<E: Display>(step: &'static str) -> impl Fn(E) -> DemoError {
    move |error| DemoError::Server { step, why: error.to_string() }
}
