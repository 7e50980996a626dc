//! Calls at a rate.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use nalgebra::{Quaternion, Vector3};

use super::recording::{RecordedCall, RecordingError};
use super::report::{Latency, RateReport};
use super::scenario::{Scenario, Share};
use super::schedule::{Arrivals, Schedule};
use super::watched::{Probes, Watched};
use crate::body::{Body, BodyId};
use crate::client::{Client, ClientError, ClientOptions, Question, StatesQuestion};
use crate::measure::Pose;
use crate::scene::query::Measure;

/// Calls that may be open at once; what is due above it is not sent, and counted.
const MOST_OPEN: u64 = 20_000;

/// Longest time to wait for the last answers.
const LAST_ANSWERS: Duration = Duration::from_secs(10);

/// Variants of each kind of call, so that not one question is asked again and again.
const VARIANTS: usize = 16;

/// Most calls of a kind of which the bytes of the answer are measured.
const MEASURED: usize = 64;

/// How load is made.
#[derive(Clone, Debug)]
pub struct LoadOptions {
    /// Connections that the calls are spread over.
    pub connections: usize,
    /// How calls arrive.
    pub arrivals: Arrivals,
    /// Time before anything counts.
    pub warmup: Duration,
    /// Time that counts.
    pub duration: Duration,
    /// Of the arrivals and of the scene.
    pub seed: u64,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The server refused the scene.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// A pose, which the scenario made too far away.
    #[error("reach_m makes a pose that is none: {0}")]
    Pose(#[from] crate::measure::PoseError),
    /// A recording that cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A body that cannot be made.
    #[error(transparent)]
    Body(#[from] crate::body::BodyError),
    /// The system has no more threads.
    #[error("cannot start the thread that keeps time: {0}")]
    Thread(#[from] std::io::Error),
}

/// A call that is ready to be made.
#[derive(Clone, Debug)]
enum Call {
    Evaluate(Box<Question>),
    States(Box<StatesQuestion>),
    Recorded(RecordedCall),
}

/// Calls of one kind.
#[derive(Debug)]
struct Kind {
    /// The weights of the kinds up to this one.
    sum: f64,
    variants: Vec<Call>,
    /// Of the next call, where they are made in their order.
    next: Option<AtomicUsize>,
}

/// A scene in a server, and the calls about it.
#[derive(Debug)]
pub struct Prepared {
    scene: String,
    /// The body of its objects, if it was not there before.
    made_body: Option<BodyId>,
    calls: Vec<Kind>,
    names: Vec<String>,
    poses: Vec<Pose>,
}

/// Makes the scene of a scenario in a server, under a name of its own.
///
/// # Errors
/// What the server refuses.
pub async fn prepare(client: &Client, scenario: &Scenario, seed: u64) -> Result<Prepared, LoadError> {
    let mut random = Schedule::new(Arrivals::Poisson, 1.0, seed);
    let scene = format!("load-{:016x}", (random.uniform() * 2_f64.powi(53)) as u64 ^ u64::from(std::process::id()));
    let names: Vec<String> = (0..scenario.objects).map(|index| format!("o{index}")).collect();
    let mut poses = Vec::new();
    for _ in 0..scenario.objects {
        poses.push(anywhere(&mut random, scenario.reach_m)?);
    }
    let (mut calls, mut sum) = (Vec::new(), 0.0);
    for share in &scenario.calls {
        sum += share.weight();
        if let Share::Recorded { file, .. } = share {
            let variants = RecordedCall::read(file)?.into_iter().map(Call::Recorded).collect();
            calls.push(Kind { sum, variants, next: Some(AtomicUsize::new(0)) });
            continue;
        }
        let mut variants = Vec::new();
        for _ in 0..VARIANTS {
            variants.extend(call(share, &names, scenario.reach_m, &mut random)?);
        }
        calls.push(Kind { sum, variants, next: None });
    }
    let body = Body::superellipsoid("brick", Vector3::zeros(), Vector3::new(0.5, 0.3, 0.2), 6)?;
    let stored = client.create_from_file(body.to_json()).await?;
    let prepared = Prepared { scene, made_body: stored.created.then_some(stored.id), calls, names, poses };
    if let Err(error) = prepared.place(client, &stored.id).await {
        // What it has made goes, and the reason stays.
        let _ = prepared.remove(client).await;
        return Err(error.into());
    }
    Ok(prepared)
}

fn call(share: &Share, names: &[String], reach_m: f64, random: &mut Schedule) -> Result<Option<Call>, LoadError> {
    let mut pick = |count: usize| ((random.uniform() * count as f64) as usize).min(count - 1);
    Ok(Some(match share {
        Share::Recorded { .. } => return Ok(None),
        Share::Pairs { pairs, .. } => {
            let chosen: Vec<(usize, usize)> = (0..*pairs)
                .map(|_| {
                    let a = pick(names.len());
                    (a, (a + 1 + pick(names.len() - 1)) % names.len())
                })
                .collect();
            let named = chosen.iter().map(|&(a, b)| (names[a].as_str(), names[b].as_str()));
            Call::Evaluate(Box::new(Question::pairs(named)))
        }
        Share::Within { margin_m, .. } => {
            let object = names[pick(names.len())].as_str();
            Call::Evaluate(Box::new(Question::within(*margin_m).with_objects([object])))
        }
        Share::States { states, moving, .. } => {
            let mut poses = Vec::with_capacity(states * moving);
            for _ in 0..states * moving {
                poses.push(anywhere(random, reach_m)?);
            }
            let objects = names[..*moving].iter().map(String::as_str);
            Call::States(Box::new(StatesQuestion::new(objects).with_states(&poses)))
        }
    }))
}

fn anywhere(random: &mut Schedule, reach_m: f64) -> Result<Pose, LoadError> {
    let mut signed = || 2.0 * random.uniform() - 1.0;
    let translation = reach_m * Vector3::from_fn(|_, _| signed());
    let rotation = Quaternion::new(signed(), signed(), signed(), signed() + 1e-3).normalize();
    Ok(Pose::from_quaternion(translation, rotation.coords.into())?)
}

impl Prepared {
    /// Name of the scene.
    pub fn scene(&self) -> &str {
        &self.scene
    }

    async fn place(&self, client: &Client, body: &BodyId) -> Result<(), ClientError> {
        client.create_scene(&self.scene).await?;
        let placed = self.names.iter().zip(&self.poses).map(|(name, pose)| (name.as_str(), body, *pose));
        client.put_objects(&self.scene, placed).await?;
        Ok(())
    }

    /// Removes what was made in the server.
    ///
    /// # Errors
    /// What the server refuses.
    pub async fn remove(&self, client: &Client) -> Result<(), LoadError> {
        match client.delete_scene(&self.scene).await {
            // It was not made any more.
            Err(error) if error.code() == Some(tonic::Code::NotFound) => {}
            deleted => deleted?,
        }
        if let Some(body) = &self.made_body {
            match client.delete_body(body).await {
                // Somebody else uses it by now.
                Err(error) if error.code() == Some(tonic::Code::FailedPrecondition) => {}
                deleted => deleted?,
            }
        }
        Ok(())
    }

    /// Bytes of an answer in the mean, measured over some of each kind.
    ///
    /// # Errors
    /// What the server refuses.
    pub async fn answer_bytes(&self, client: &Client) -> Result<usize, LoadError> {
        let (mut bytes, mut total) = (0.0, 0.0);
        let mut before = 0.0;
        for Kind { sum, variants, .. } in &self.calls {
            let measured = &variants[..variants.len().min(MEASURED)];
            let weight = (sum - before) / measured.len() as f64;
            before = *sum;
            for call in measured {
                bytes += weight * self.send(client, call).await? as f64;
                total += weight;
            }
        }
        Ok((bytes / total) as usize)
    }

    /// Makes a call; returns the bytes of its answer.
    async fn send(&self, client: &Client, call: &Call) -> Result<usize, ClientError> {
        match call {
            Call::Evaluate(question) => client.evaluate_bytes(&self.scene, question, &[Measure::Distance]).await,
            Call::States(question) => client.check_states_bytes(&self.scene, question).await,
            Call::Recorded(recorded) => client.raw(&recorded.call, recorded.message.clone()).await,
        }
    }

    /// Moves a tenth of the objects to and fro, so many times a second, until it is dropped.
    pub async fn stream(self: Arc<Self>, client: Client, rate_hz: f64) -> Result<(), ClientError> {
        let moving = self.names.len().div_ceil(10);
        let mut stream = client.stream_poses(&self.scene, self.names[..moving].iter().map(String::as_str)).await?;
        let mut beat = tokio::time::interval(Duration::from_secs_f64(1.0 / rate_hz));
        loop {
            tokio::select! {
                _ = beat.tick() => { stream.send(&self.poses[..moving]).await?; }
                reply = stream.next() => if reply?.is_none() { return Ok(()) },
            }
        }
    }
}

/// What tasks count together.
#[derive(Debug)]
struct Counted {
    open: AtomicU64,
    answered: AtomicU64,
    latency_ns: Mutex<Histogram<u64>>,
    errors: Mutex<BTreeMap<String, u64>>,
}

impl Counted {
    fn failed(&self, code: String) {
        *self.errors.lock().unwrap_or_else(PoisonError::into_inner).entry(code).or_insert(0) += 1;
    }
}

/// Makes calls at a rate over some connections, and counts from when each was due. `progress` gets
/// the seconds that are over and the answers so far; the server is looked at meanwhile.
///
/// # Errors
/// When the system has no thread to keep time.
pub async fn measure(
    prepared: &Arc<Prepared>,
    clients: &[Client],
    (rate_per_s, server): (f64, &Watched),
    options: &LoadOptions,
    progress: &mut dyn FnMut(f64, u64),
) -> Result<RateReport, LoadError> {
    let before = (Instant::now(), server.worked());
    let probes = server.probe.clone().map(Probes::start);
    // Three digits, up to an hour.
    let latency_ns = Histogram::new_with_bounds(1000, 3_600_000_000_000, 3);
    let latency_ns = latency_ns.unwrap_or_else(|_| unreachable!("the bounds are in order"));
    let counted = Arc::new(Counted {
        open: AtomicU64::new(0),
        answered: AtomicU64::new(0),
        latency_ns: Mutex::new(latency_ns),
        errors: Mutex::default(),
    });
    let whole = options.warmup + options.duration;
    let (start, runtime) = (Instant::now() + Duration::from_millis(50), tokio::runtime::Handle::current());
    // A thread: timers of the runtime are a millisecond wide, and calls are due between.
    let keeping = {
        let (counted, prepared, clients, options) =
            (counted.clone(), prepared.clone(), clients.to_vec(), options.clone());
        std::thread::Builder::new().name("load".into()).spawn(move || {
            keep_time(start, whole, rate_per_s, &options, |due, index, random| {
                let counts = due >= start + options.warmup;
                let arrival = Arrival { due, random, counts };
                begin(&runtime, (&prepared, &clients[index % clients.len()]), arrival, counted.clone());
                counts
            })
        })?
    };
    while start.elapsed() < whole {
        tokio::time::sleep(Duration::from_millis(200).min(whole)).await;
        progress(start.elapsed().as_secs_f64(), counted.answered.load(Ordering::Relaxed));
    }
    let due = tokio::task::spawn_blocking(move || keeping.join().unwrap_or(0)).await.unwrap_or(0);
    let last = Instant::now();
    while counted.open.load(Ordering::Acquire) > 0 && last.elapsed() < LAST_ANSWERS {
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let unanswered = counted.open.load(Ordering::Acquire);
    if unanswered > 0 {
        *counted.errors.lock().unwrap_or_else(PoisonError::into_inner).entry("UNANSWERED".into()).or_insert(0) +=
            unanswered;
    }
    let took = before.0.elapsed().as_secs_f64();
    let now = server.worked();
    let cores = |index: usize| Some((now[index]? - before.1[index]?) / took);
    let latency = counted.latency_ns.lock().unwrap_or_else(PoisonError::into_inner);
    let seconds = options.duration.as_secs_f64();
    Ok(RateReport {
        offered_per_s: rate_per_s,
        answered_per_s: latency.len() as f64 / seconds,
        due,
        errors: counted.errors.lock().unwrap_or_else(PoisonError::into_inner).clone(),
        latency_ms: Latency::of(&latency),
        client_cores: cores(1),
        server_cores: cores(0),
        server_mib: server.memory_mib(),
        health: probes.map(|probes| probes.health()),
    })
}

/// Begins calls when they are due; returns how many of them count.
fn keep_time(
    start: Instant,
    whole: Duration,
    rate_per_s: f64,
    options: &LoadOptions,
    begin: impl Fn(Instant, usize, f64) -> bool,
) -> u64 {
    let mut schedule = Schedule::new(options.arrivals, rate_per_s, options.seed);
    let mut choice = Schedule::new(Arrivals::Constant, 1.0, options.seed ^ 0x5bd1);
    let mut counted = 0;
    for index in 0.. {
        let due = schedule.next();
        if due >= whole {
            break;
        }
        std::thread::sleep((start + due).saturating_duration_since(Instant::now()));
        counted += u64::from(begin(start + due, index, choice.uniform()));
    }
    counted
}

/// A call that is due.
struct Arrival {
    due: Instant,
    /// Chooses the call, in (0, 1].
    random: f64,
    /// Whether its answer counts; not during the warm-up.
    counts: bool,
}

fn begin(
    runtime: &tokio::runtime::Handle,
    (prepared, client): (&Arc<Prepared>, &Client),
    Arrival { due, random, counts }: Arrival,
    counted: Arc<Counted>,
) {
    if counted.open.load(Ordering::Relaxed) >= MOST_OPEN {
        if counts {
            counted.failed("NOT_SENT".into());
        }
        return;
    }
    counted.open.fetch_add(1, Ordering::AcqRel);
    let (prepared, client) = (prepared.clone(), client.clone());
    runtime.spawn(async move {
        let call = prepared.chosen(random);
        let answered = prepared.send(&client, call).await;
        let took = due.elapsed();
        if counts {
            match answered {
                Ok(_) => {
                    let nanoseconds = u64::try_from(took.as_nanos()).unwrap_or(u64::MAX);
                    counted.latency_ns.lock().unwrap_or_else(PoisonError::into_inner).saturating_record(nanoseconds);
                    counted.answered.fetch_add(1, Ordering::Relaxed);
                }
                Err(error) => counted.failed(code(&error)),
            }
        }
        counted.open.fetch_sub(1, Ordering::AcqRel);
    });
}

impl Prepared {
    /// A call for a number in (0, 1].
    fn chosen(&self, random: f64) -> &Call {
        let total = self.calls.last().map_or(1.0, |kind| kind.sum);
        let at = random * total;
        let kind = self.calls.iter().position(|kind| at <= kind.sum).unwrap_or(0);
        let Kind { sum, variants, next } = &self.calls[kind];
        if let Some(next) = next {
            return &variants[next.fetch_add(1, Ordering::Relaxed) % variants.len()];
        }
        let before = if kind == 0 { 0.0 } else { self.calls[kind - 1].sum };
        let within = (at - before) / (sum - before);
        &variants[((within * variants.len() as f64) as usize).min(variants.len() - 1)]
    }
}

fn code(error: &ClientError) -> String {
    error.code().map_or_else(|| "CONNECTION".into(), |code| format!("{code:?}"))
}

/// Connections to a server.
///
/// # Errors
/// When nobody answers.
pub async fn connect(url: &str, options: &ClientOptions, count: usize) -> Result<Vec<Client>, ClientError> {
    let mut clients = Vec::with_capacity(count);
    for _ in 0..count {
        clients.push(Client::connect_with(url, options).await?);
    }
    Ok(clients)
}
