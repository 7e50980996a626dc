//! The chair swept through the human, over gRPC against a real server.

use super::error::DemoError;
use crate::client::{Client, PairRow, Question};
use crate::measure::Pose;
use crate::scene::query::Measure;
use crate::service::{Config, Server};
use nalgebra::Vector3;
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
        let server = Server::bind(Config { listen, data: data.path().to_owned(), ..Config::default() })
            .await
            .map_err(failed(step))?;
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
    let client = Client::connect(url).await.map_err(failed("connecting"))?;
    let mut bodies = Vec::new();
    for file in [chair, human] {
        let json = std::fs::read_to_string(file).map_err(|source| DemoError::File { path: file.into(), source })?;
        bodies.push(client.create_from_file(json).await.map_err(failed("storing a body"))?.id);
    }
    client.create_scene(SCENE).await.map_err(failed("creating the scene"))?;
    let objects = [(CHAIR, &bodies[0], at(-REACH)?), (HUMAN, &bodies[1], at(0.0)?)];
    client.put_objects(SCENE, objects).await.map_err(failed("placing the objects"))?;

    let measures = [Measure::Distance, Measure::LevelAOnB, Measure::LevelBOnA];
    let mut sweep = Sweep { samples: Vec::with_capacity(STEPS), revision: 0, elapsed: Duration::ZERO };
    let start = Instant::now();
    for step in 0..STEPS {
        let x = REACH * (2.0 * step as f64 / (STEPS - 1) as f64 - 1.0);
        sweep.revision = client.set_poses(SCENE, [(CHAIR, at(x)?)]).await.map_err(failed("moving the chair"))?;
        let question = Question::pairs([(CHAIR, HUMAN)]);
        let answers = client.evaluate(SCENE, question, &measures).await.map_err(failed("asking for distances"))?;
        let sample = sample(x, &answers.rows).ok_or("the reply does not answer what was asked");
        sweep.samples.push(sample.map_err(failed("asking for distances"))?);
    }
    sweep.elapsed = start.elapsed();
    Ok(sweep)
}

/// Upright at `x` metres.
fn at(x: f64) -> Result<Pose, DemoError> {
    Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).map_err(failed("placing the objects"))
}

/// The three answers in the order asked for.
fn sample(x: f64, rows: &[PairRow]) -> Option<Sample> {
    let answer = |row: &PairRow| Some(Answer { value: row.value?, lower: row.answer.lower, upper: row.answer.upper });
    let [distance, chair_on_human, human_on_chair] = rows else { return None };
    Some(Sample {
        x,
        distance: answer(distance)?,
        chair_on_human: answer(chair_on_human)?,
        human_on_chair: answer(human_on_chair)?,
    })
}

fn failed<E: Display>(step: &'static str) -> impl Fn(E) -> DemoError {
    move |error| DemoError::Server { step, why: error.to_string() }
}
