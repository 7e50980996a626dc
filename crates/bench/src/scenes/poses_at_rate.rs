//! Poses at 1 kHz beside clients that ask: how old the poses are that an answer is true of.

use std::collections::BTreeMap;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use sublevel::client::{Client, ClientError, Question};
use sublevel::measure::{Pose, PoseError};
use sublevel::scene::query::Measure;
use tokio::time::MissedTickBehavior;

use super::bricks::{anywhere, brick};
use crate::comparison::Random;
use crate::loopback::Loopback;

/// Objects of the scene, of which so many are streamed.
const OBJECTS: usize = 1000;
const STREAMED: usize = 100;
/// Messages with poses a second.
const RATE_HZ: u64 = 1000;
/// Clients that ask, each on a connection of its own.
const CLIENTS: usize = 4;
const SCENE: &str = "cell";

/// Ages of poses at the answers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ages {
    /// Questions that the server can answer in a second, without a stream.
    pub(super) capacity_per_s: f64,
    /// Questions that were answered in a second beside the stream.
    pub(super) asked_per_s: f64,
    /// Messages with poses that were sent in a second.
    pub(super) sent_per_s: f64,
    /// Time from the sending of the latest message that an answer is true of to the answer, median
    /// and 99th percentile, milliseconds.
    pub(super) median_ms: f64,
    pub(super) p99_ms: f64,
}

/// Streams poses for so many seconds at 1 kHz, and asks at half of what the server can answer.
pub(super) fn ages(seconds: f64) -> Result<Ages, Box<dyn Error>> {
    let server = Loopback::start()?;
    let clients = (0..CLIENTS + 1).map(|_| server.connect()).collect::<Result<Vec<_>, _>>()?;
    let poses: Vec<Pose> = {
        let mut random = Random(8);
        (0..OBJECTS).map(|_| anywhere(&mut random, 4.0)).collect::<Result<_, PoseError>>()?
    };
    let names: Arc<Vec<String>> = Arc::new((0..OBJECTS).map(|index| format!("o{index}")).collect());
    let (streaming, asking) = (clients[0].clone(), clients[1..].to_vec());
    let duration = Duration::from_secs_f64(seconds);
    let ages = server.clients().block_on(async {
        let id = streaming.create_from_file(brick()?.to_json()).await?.id;
        streaming.create_scene(SCENE).await?;
        let objects = names.iter().zip(&poses).map(|(name, pose)| (name.as_str(), &id, *pose));
        streaming.put_objects(SCENE, objects).await?;
        let capacity = ask(&asking, &names, duration, None).await?.len() as f64 / seconds;
        let pause = Duration::from_secs_f64(2.0 * CLIENTS as f64 / capacity);
        let done = Arc::new(AtomicBool::new(false));
        let stream = tokio::spawn(stream(streaming, names.clone(), poses, done.clone()));
        let answers = ask(&asking, &names, duration, Some(pause)).await?;
        done.store(true, Ordering::Relaxed);
        let (sent, known) = stream.await??;
        Ok::<_, Box<dyn Error>>(evaluate(&answers, &sent, &known, (capacity, seconds)))
    })?;
    server.stop()?;
    ages
}

/// Asks what is within 5 cm of a streamed object, again and again; returns when answers came and
/// of which revision they are true. With a pause, a client begins a question at every such time.
async fn ask(
    clients: &[Client],
    names: &Arc<Vec<String>>,
    duration: Duration,
    pause: Option<Duration>,
) -> Result<Vec<(Instant, u64)>, Box<dyn Error>> {
    let (end, count) = (Instant::now() + duration, Arc::new(AtomicU64::new(0)));
    let mut asking = Vec::new();
    for client in clients {
        let (client, names, count) = (client.clone(), names.clone(), count.clone());
        asking.push(tokio::spawn(async move {
            let mut answers = Vec::new();
            let mut beat = pause.map(tokio::time::interval);
            if let Some(beat) = &mut beat {
                beat.set_missed_tick_behavior(MissedTickBehavior::Delay);
            }
            while Instant::now() < end {
                if let Some(beat) = &mut beat {
                    beat.tick().await;
                }
                let index = usize::try_from(count.fetch_add(1, Ordering::Relaxed)).unwrap_or(0) % STREAMED;
                let question = Question::within(0.05).with_objects([names[index].as_str()]);
                let revision = client.evaluate(SCENE, question, &[Measure::Distance]).await?.revision;
                answers.push((Instant::now(), revision));
            }
            Ok::<_, ClientError>(answers)
        }));
    }
    let mut all = Vec::new();
    for asking in asking {
        all.extend(asking.await??);
    }
    Ok(all)
}

/// Streams poses; returns when each message was sent, and up to which message the scene was at
/// revisions.
async fn stream(
    client: Client,
    names: Arc<Vec<String>>,
    poses: Vec<Pose>,
    done: Arc<AtomicBool>,
) -> Result<(Vec<(u64, Instant)>, BTreeMap<u64, u64>), ClientError> {
    let mut stream = client.stream_poses(SCENE, names[..STREAMED].iter().map(String::as_str)).await?;
    let mut beat = tokio::time::interval(Duration::from_micros(1_000_000 / RATE_HZ));
    beat.set_missed_tick_behavior(MissedTickBehavior::Burst);
    let (mut sent, mut known) = (Vec::new(), BTreeMap::new());
    let mut random = Random(9);
    while !done.load(Ordering::Relaxed) {
        tokio::select! {
            _ = beat.tick() => {
                let shaken: Vec<Pose> = poses[..STREAMED].iter().map(|pose| shaken(pose, &mut random)).collect();
                let now = Instant::now();
                sent.push((stream.send(&shaken).await?, now));
            }
            reply = stream.next() => {
                let Some(reply) = reply? else { break };
                known.insert(reply.revision, reply.sequence);
            }
        }
    }
    Ok((sent, known))
}

fn shaken(pose: &Pose, random: &mut Random) -> Pose {
    let by = 1e-3 * Vector3::from_fn(|_, _| random.signed());
    Pose::from_quaternion(pose.translation() + by, pose.rotation().coords.into()).unwrap_or(*pose)
}

fn evaluate(
    answers: &[(Instant, u64)],
    sent: &[(u64, Instant)],
    known: &BTreeMap<u64, u64>,
    (capacity_per_s, seconds): (f64, f64),
) -> Result<Ages, Box<dyn Error>> {
    let times: BTreeMap<u64, Instant> = sent.iter().copied().collect();
    let age = |(at, revision): &(Instant, u64)| {
        let (_, sequence) = known.range(..=revision).next_back()?;
        Some(1e3 * at.saturating_duration_since(*times.get(sequence)?).as_secs_f64())
    };
    // Answers from before the first message and from after the last are of no age.
    let last = sent.last().ok_or("nothing was streamed")?.1;
    let mut ages: Vec<f64> = answers.iter().filter(|(at, _)| *at <= last).filter_map(age).collect();
    ages.sort_by(f64::total_cmp);
    let at = |part: f64| ages.get((part * (ages.len() as f64 - 1.0)) as usize).copied().ok_or("nothing was answered");
    Ok(Ages {
        capacity_per_s,
        asked_per_s: answers.len() as f64 / seconds,
        sent_per_s: sent.len() as f64 / seconds,
        median_ms: at(0.5)?,
        p99_ms: at(0.99)?,
    })
}
