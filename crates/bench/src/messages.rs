//! Times messages to a server on loopback, for `sublevel-bench cost`.

use crate::comparison::{Random, sweep::median};
use std::error::Error;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::{Duration, Instant};
use sublevel::body::Body;
use sublevel::service::limits::MAX_MESSAGE_BYTES;
use sublevel::service::proto::body_service_client::BodyServiceClient;
use sublevel::service::proto::query_service_client::QueryServiceClient;
use sublevel::service::proto::scene_service_client::SceneServiceClient;
use sublevel::service::proto::{
    CreateBodyRequest, CreateSceneRequest, EvaluateRequest, Measure, Object, ObjectPair, Pose, Quaternion,
    UpdateSceneRequest, Vector3,
};
use sublevel::service::{ServeOptions, Server};

const SCENE: &str = "cost";
/// Objects of each of two kinds: all pairs of them are the most pairs of a message.
const OBJECTS: usize = 64;
/// Half of the edge of the cube that they are scattered over, metres.
const REACH: f64 = 10.0;
/// How often each message is sent.
const REPEATS: usize = 9;

/// Nanoseconds of an Evaluate with this many pairs, none of them twice, for each of the sizes:
/// medians, one connection.
pub(crate) fn messages(sizes: &[usize]) -> Result<Vec<f64>, Box<dyn Error>> {
    let data = tempfile::Builder::new().prefix("sublevel-cost-").tempdir()?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let result = runtime.block_on(async {
        let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        let server = Server::bind(ServeOptions { listen, data: data.path().to_owned() }).await?;
        let url = format!("http://{}", server.local_addr());
        let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
        let serving = tokio::spawn(server.run(async {
            let _ = stopped.await;
        }));
        let result = talk(url, sizes).await;
        let _ = stop.send(());
        serving.await??;
        result
    });
    runtime.shutdown_timeout(Duration::from_secs(1));
    result
}

/// The client's side.
async fn talk(url: String, sizes: &[usize]) -> Result<Vec<f64>, Box<dyn Error>> {
    let mut bodies = BodyServiceClient::connect(url.clone()).await?;
    let mut random = Random(1);
    let mut upsert_objects = Vec::new();
    for (kind, [x, y, z]) in [("brick", [0.5, 0.3, 0.2]), ("post", [0.2, 0.2, 0.9])] {
        let body = Body::superellipsoid(kind, nalgebra::Vector3::zeros(), nalgebra::Vector3::new(x, y, z), 4)?;
        let request = CreateBodyRequest { body_file_json: body.to_json().into_bytes().into() };
        let stored = bodies.create_body(request).await?.into_inner().body.ok_or("the reply holds no body")?;
        for index in 0..OBJECTS {
            let (q, t) = (random.rotation(), [0; 3].map(|_| REACH * random.signed()));
            let pose = Pose {
                translation_m: Some(Vector3 { x: t[0], y: t[1], z: t[2] }),
                rotation: Some(Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }),
            };
            let name = format!("{kind}-{index}");
            upsert_objects.push(Object { name, body_id: stored.id.clone(), pose: Some(pose), group: String::new() });
        }
    }
    let mut scenes = SceneServiceClient::connect(url.clone()).await?;
    scenes.create_scene(CreateSceneRequest { name: SCENE.into() }).await?;
    scenes.update_scene(UpdateSceneRequest { name: SCENE.into(), upsert_objects, ..Default::default() }).await?;

    let all: Vec<ObjectPair> = (0..OBJECTS * OBJECTS)
        .map(|i| ObjectPair { a: format!("brick-{}", i % OBJECTS), b: format!("post-{}", i / OBJECTS) })
        .collect();
    let mut queries = QueryServiceClient::connect(url).await?.max_decoding_message_size(MAX_MESSAGE_BYTES);
    let mut times = Vec::new();
    for &size in sizes {
        let pairs = all.get(..size).ok_or("more pairs than there are")?.to_vec();
        let measures = vec![Measure::Distance.into()];
        let question = EvaluateRequest { scene: SCENE.into(), pairs, measures, ..Default::default() };
        let mut runs = Vec::new();
        // The first one finds everything cold.
        for _ in 0..=REPEATS {
            let question = question.clone();
            let start = Instant::now();
            let answers = queries.evaluate(question).await?.into_inner();
            runs.push(start.elapsed().as_nanos() as f64);
            if answers.results.len() != size {
                return Err("the reply does not answer what was asked".into());
            }
        }
        times.push(median(&runs[1..]));
    }
    Ok(times)
}

#[cfg(test)]
mod tests {
    use super::{OBJECTS, messages};

    #[test]
    fn messages_of_all_sizes_are_answered() {
        let times = messages(&[1, 70, OBJECTS * OBJECTS]).unwrap();
        assert!(times.len() == 3 && times.iter().all(|ns| *ns > 0.0), "{times:?}");
        assert!(messages(&[OBJECTS * OBJECTS + 1]).is_err());
    }
}
