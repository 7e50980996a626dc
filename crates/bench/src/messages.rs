//! Times messages to a server on loopback, for `sublevel-bench cost`.

use crate::comparison::{Random, sweep::median};
use crate::loopback::Loopback;
use nalgebra::Vector3;
use std::error::Error;
use std::time::Instant;
use sublevel::body::Body;
use sublevel::client::{Client, Question};
use sublevel::measure::Pose;
use sublevel::scene::query::Measure;
use sublevel::service::proto::Output;

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
    let server = Loopback::start()?;
    let client = server.connect()?;
    let times = server.clients().block_on(talk(&client, sizes))?;
    server.stop()?;
    Ok(times)
}

/// The client's side.
async fn talk(client: &Client, sizes: &[usize]) -> Result<Vec<f64>, Box<dyn Error>> {
    client.create_scene(SCENE).await?;
    let mut random = Random(1);
    for (kind, [x, y, z]) in [("brick", [0.5, 0.3, 0.2]), ("post", [0.2, 0.2, 0.9])] {
        let body = Body::superellipsoid(kind, Vector3::zeros(), Vector3::new(x, y, z), 4)?;
        let stored = client.create_from_file(body.to_json()).await?;
        let mut objects = Vec::new();
        for index in 0..OBJECTS {
            let (rotation, translation) = (random.rotation(), [0; 3].map(|_| REACH * random.signed()));
            let pose = Pose::from_quaternion(translation.into(), rotation.coords.into())?;
            objects.push((format!("{kind}-{index}"), pose));
        }
        client.put_objects(SCENE, objects.iter().map(|(name, pose)| (name.as_str(), &stored.id, *pose))).await?;
    }
    let all: Vec<(String, String)> =
        (0..OBJECTS * OBJECTS).map(|i| (format!("brick-{}", i % OBJECTS), format!("post-{}", i / OBJECTS))).collect();
    let mut times = Vec::new();
    for &size in sizes {
        let pairs = all.get(..size).ok_or("more pairs than there are")?;
        let mut question = Question::pairs(pairs.iter().map(|(a, b)| (a.as_str(), b.as_str())));
        question.request_mut().outputs = vec![Output::Value.into()];
        let mut runs = Vec::new();
        // The first one finds everything cold.
        for _ in 0..=REPEATS {
            let question = question.clone();
            let start = Instant::now();
            let answers = client.evaluate(SCENE, question, &[Measure::Distance]).await?;
            runs.push(start.elapsed().as_nanos() as f64);
            if answers.rows.len() != size {
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
