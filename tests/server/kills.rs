//! Kills under load, with a ledger of what was acknowledged: nothing of it is lost, nothing is
//! there that nobody asked for, and revisions never go back. `SUBLEVEL_LONG=1000` kills that often.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use sublevel::body::{Body, BodyId};
use sublevel::client::{Client, ClientError};
use sublevel::measure::Pose;
use sublevel::scene::{Placement, Update};
use sublevel::service::proto::ListBodiesRequest;
use sublevel_testkit::random::draws;

use crate::harness::{Numbers, Running};

/// Clients that write at the same time, each for itself.
const WRITERS: usize = 3;

/// Streamed poses may be lost that came within this time before the kill, seconds: half a second
/// until they are written, and what that takes on a busy machine.
const STREAMED_S: f64 = 1.0;

/// What one writer knows to be stored.
#[derive(Clone, Debug, Default, PartialEq)]
struct Stored {
    bodies: BTreeSet<BodyId>,
    /// Objects of scenes: body, and where it stands along x, metres.
    scenes: BTreeMap<String, BTreeMap<String, (BodyId, f64)>>,
}

/// A change that a writer asks for.
#[derive(Clone)]
enum Change {
    CreateBody(Box<Body>),
    DeleteBody(BodyId),
    CreateScene(String),
    DeleteScene(String),
    Put {
        scene: String,
        object: String,
        body: BodyId,
        x: f64,
    },
    Move {
        scene: String,
        object: String,
        x: f64,
    },
    /// The same by a fork.
    Commit {
        scene: String,
        object: String,
        x: f64,
    },
    Remove {
        scene: String,
        object: String,
    },
}

/// A writer over all kills.
struct Writer {
    name: String,
    /// Radius of its first body, metres.
    size: f64,
    numbers: Numbers,
    stored: Stored,
    /// Begun, and not answered.
    pending: Option<Change>,
    /// The latest revision of each scene name that anybody has seen.
    revisions: BTreeMap<String, u64>,
    made: u32,
    acknowledged: u64,
}

fn along(x: f64) -> Pose {
    Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).expect("a pose")
}

impl fmt::Debug for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CreateBody(body) => write!(f, "create body {} {}", body.name(), body.id()),
            Self::DeleteBody(id) => write!(f, "delete body {id}"),
            Self::CreateScene(scene) => write!(f, "create {scene}"),
            Self::DeleteScene(scene) => write!(f, "delete {scene}"),
            Self::Put { scene, object, body, x } => write!(f, "put {object} of body {body} into {scene} at {x}"),
            Self::Move { scene, object, x } => write!(f, "move {object} of {scene} to {x}"),
            Self::Commit { scene, object, x } => write!(f, "move {object} of {scene} to {x} by a fork"),
            Self::Remove { scene, object } => write!(f, "remove {object} of {scene}"),
        }
    }
}

impl Stored {
    fn apply(&mut self, change: &Change) {
        let mut put = |scene: &str, object: &str, change: &dyn Fn(&mut (BodyId, f64))| {
            let objects = self.scenes.get_mut(scene).expect("a scene of the ledger");
            change(objects.get_mut(object).expect("an object of the ledger"));
        };
        match change {
            Change::CreateBody(body) => drop(self.bodies.insert(*body.id())),
            Change::DeleteBody(id) => drop(self.bodies.remove(id)),
            Change::CreateScene(scene) => drop(self.scenes.insert(scene.clone(), BTreeMap::new())),
            Change::DeleteScene(scene) => drop(self.scenes.remove(scene)),
            Change::Put { scene, object, body, x } => {
                self.scenes.get_mut(scene).expect("a scene of the ledger").insert(object.clone(), (*body, *x));
            }
            Change::Move { scene, object, x } | Change::Commit { scene, object, x } => {
                put(scene, object, &|o| o.1 = *x);
            }
            Change::Remove { scene, object } => {
                self.scenes.get_mut(scene).expect("a scene of the ledger").remove(object);
            }
        }
    }
}

impl Writer {
    fn new(index: usize) -> Self {
        Self {
            name: format!("w{index}"),
            size: 1.0 + index as f64,
            numbers: Numbers(index as u64 + 1),
            stored: Stored::default(),
            pending: None,
            revisions: BTreeMap::new(),
            made: 0,
            acknowledged: 0,
        }
    }

    fn choose(&mut self, count: usize) -> usize {
        let share = f64::midpoint(self.numbers.next(), 1.0);
        ((share * count as f64) as usize).min(count - 1)
    }

    /// A change that the ledger allows.
    fn next(&mut self) -> Change {
        let (made, x) = (self.made, self.numbers.next());
        self.made += 1;
        let kind = self.choose(8);
        let scenes: Vec<String> = self.stored.scenes.keys().cloned().collect();
        let bodies: Vec<BodyId> = self.stored.bodies.iter().copied().collect();
        if bodies.len() < 2 || kind == 0 && bodies.len() < 12 {
            // An id says nothing about the name, so everybody has sizes of their own.
            let radius = self.size + 1e-6 * f64::from(made);
            let body = Body::ball(&format!("{}-{made}", self.name), Vector3::zeros(), radius);
            return Change::CreateBody(Box::new(body.expect("a ball")));
        }
        // Names come again, so that a scene has to begin above the one that had its name.
        let scene = self.choose(4);
        let scene = format!("{}-{scene}", self.name);
        if !self.stored.scenes.contains_key(&scene) {
            return Change::CreateScene(scene);
        }
        let objects = &self.stored.scenes[&scene];
        let names: Vec<String> = objects.keys().cloned().collect();
        let used: BTreeSet<BodyId> = self.stored.scenes.values().flatten().map(|(_, (body, _))| *body).collect();
        let unused: Vec<BodyId> = bodies.iter().copied().filter(|id| !used.contains(id)).collect();
        let object = if names.is_empty() { None } else { Some(names[self.choose(names.len())].clone()) };
        match (kind, object) {
            (1, _) if unused.len() > 1 => Change::DeleteBody(unused[self.choose(unused.len())]),
            (2, _) if scenes.len() > 2 => Change::DeleteScene(scene),
            (3 | 4, Some(object)) => Change::Move { scene, object, x },
            (5, Some(object)) => Change::Commit { scene, object, x },
            (6, Some(object)) => Change::Remove { scene, object },
            _ => {
                let object = format!("o{}", self.choose(8));
                Change::Put { scene, object, body: bodies[self.choose(bodies.len())], x }
            }
        }
    }

    /// Asks for changes until the server is gone.
    async fn write(mut self, client: Client) -> Self {
        loop {
            let change = self.next();
            self.pending = Some(change.clone());
            match self.ask(&client, &change).await {
                Ok(revision) => {
                    self.pending = None;
                    self.stored.apply(&change);
                    self.acknowledged += 1;
                    if let Some((scene, revision)) = revision {
                        let before = self.revisions.insert(scene.clone(), revision);
                        assert!(before.is_none_or(|before| before < revision), "{scene}: {before:?}, then {revision}");
                    }
                }
                Err(ClientError::Refused(status)) if !is_end(&status) => panic!("{change:?}: {status}"),
                Err(_) => return self,
            }
        }
    }

    /// Returns the revision that it leads to.
    async fn ask(&self, client: &Client, change: &Change) -> Result<Option<(String, u64)>, ClientError> {
        let placed = |object: &str, body: BodyId, x: f64| {
            let (name, pose) = (object.into(), Some(along(x)));
            Placement { name, body, pose, group: "".into(), padding_m: None, attachment: None }
        };
        let (scene, revision) = match change {
            Change::CreateBody(body) => {
                let made = client.create_from_file(body.to_json()).await?;
                assert_eq!(made.id, *body.id());
                return Ok(None);
            }
            Change::DeleteBody(id) => {
                client.delete_body(id).await?;
                return Ok(None);
            }
            Change::DeleteScene(scene) => {
                client.delete_scene(scene).await?;
                return Ok(None);
            }
            Change::CreateScene(scene) => (scene, client.create_scene(scene).await?),
            Change::Put { scene, object, body, x } => {
                let update = Update { upserts: vec![placed(object, *body, *x)], ..Update::default() };
                (scene, client.update_scene(scene, &update).await?)
            }
            Change::Move { scene, object, x } => {
                (scene, client.set_poses(scene, [(object.as_str(), along(*x))]).await?)
            }
            Change::Commit { scene, object, x } => {
                let fork = format!("{scene}-plan");
                client.fork_scene(scene, &fork).await?;
                client.set_poses(&fork, [(object.as_str(), along(*x))]).await?;
                (scene, client.commit_fork(&fork).await?)
            }
            Change::Remove { scene, object } => {
                let update = Update { removals: vec![object.as_str().into()], ..Update::default() };
                (scene, client.update_scene(scene, &update).await?)
            }
        };
        Ok(Some((scene.clone(), revision)))
    }

    /// What is there is what was acknowledged, with or without the change that was not answered.
    fn settle(&mut self, found: Stored, revisions: &BTreeMap<String, u64>, round: u64) {
        let pending = self.pending.take();
        if found != self.stored {
            let mut with = self.stored.clone();
            pending.iter().for_each(|change| with.apply(change));
            assert_eq!(found, with, "round {round}, {}: not answered was {pending:?}", self.name);
            self.stored = found;
        }
        for (scene, &revision) in revisions.iter().filter(|(scene, _)| scene.starts_with(&self.name)) {
            let seen = self.revisions.get(scene).copied().unwrap_or(0);
            assert!(revision >= seen, "round {round}: {scene} went back from {seen} to {revision}");
            self.revisions.insert(scene.clone(), revision);
        }
    }
}

/// The server was killed while it answered.
fn is_end(status: &tonic::Status) -> bool {
    matches!(status.code(), tonic::Code::Unavailable | tonic::Code::Unknown | tonic::Code::Cancelled)
}

/// Poses of one object, numbered along x, and when they were acknowledged.
#[derive(Debug, Default)]
struct Streamed {
    sent: u64,
    acknowledged: Vec<(Instant, u64)>,
    /// What was on disk at the last start.
    durable: u64,
    revision: u64,
}

impl Streamed {
    async fn write(mut self, client: Client) -> Self {
        let Ok(mut stream) = client.stream_poses("stream", ["o"]).await else { return self };
        // Messages count from 1 in every stream, the first names the object.
        let begun = self.sent;
        loop {
            self.sent += 1;
            let Ok(_) = stream.send(&[along(self.sent as f64)]).await else { return self };
            let Ok(Some(said)) = stream.next().await else { return self };
            assert!(said.revision >= self.revision, "{} after {}", said.revision, self.revision);
            self.revision = said.revision;
            self.acknowledged.push((Instant::now(), begun + said.sequence));
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    }

    /// The pose on disk is one that was sent, at most a second older than the last.
    fn settle(&mut self, x: f64, revision: u64, killed: Instant, round: u64) {
        let old = |at: &Instant| (killed - *at).as_secs_f64() > STREAMED_S;
        let least =
            self.acknowledged.iter().rev().find(|(at, _)| old(at)).map_or(0, |(_, number)| *number).max(self.durable);
        assert!((least..=self.sent).contains(&(x as u64)), "round {round}: {x} is not in {least}..={}", self.sent);
        assert!(revision >= self.revision, "round {round}: {revision} after {}", self.revision);
        (self.acknowledged, self.durable, self.revision) = (Vec::new(), x as u64, revision);
    }
}

/// Everything that is there: by writer, with revisions; and the streamed object.
async fn look(server: &Running, client: &Client) -> (Vec<Stored>, BTreeMap<String, u64>, Option<(f64, u64)>) {
    let mut found = vec![Stored::default(); WRITERS];
    let (mut revisions, mut streamed) = (BTreeMap::new(), None);
    let owner = |name: &str| (0..WRITERS).find(|writer| name.starts_with(&format!("w{writer}-")));
    let mut raw = server.connect().await;
    let mut page_token = String::new();
    loop {
        let page = raw.bodies.list_bodies(ListBodiesRequest { page_size: 1000, page_token }).await.expect("a page");
        let page = page.into_inner();
        for body in page.bodies.iter().filter(|body| body.name != "streamed") {
            let writer = owner(&body.name).unwrap_or_else(|| panic!("nobody made body {}", body.name));
            found[writer].bodies.insert(body.id.parse().expect("an id"));
        }
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    for summary in client.list_scenes().await.expect("a list") {
        let state = client.scene(&summary.name).await.expect("a scene");
        revisions.insert(summary.name.clone(), state.revision);
        let x = |placement: &Placement| placement.pose.expect("free").translation().x;
        if summary.name == "stream" {
            streamed = Some((x(&state.objects["o"]), state.revision));
            continue;
        }
        let writer = owner(&summary.name).unwrap_or_else(|| panic!("nobody made scene {}", summary.name));
        let objects = state.objects.values().map(|placed| (placed.name.to_string(), (placed.body, x(placed))));
        found[writer].scenes.insert(summary.name, objects.collect());
    }
    (found, revisions, streamed)
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_acknowledged_survives_kills_and_nothing_else_is_there() {
    let dir = tempfile::tempdir().expect("a directory");
    let rounds = draws(8);
    let mut writers: Vec<Writer> = (0..WRITERS).map(Writer::new).collect();
    let mut streamed = Streamed::default();
    let mut numbers = Numbers(99);
    {
        let server = Running::start(dir.path());
        let client = server.client().await;
        let body = client.create_ball("streamed", 0.1).await.expect("stored");
        client.create_scene("stream").await.expect("made");
        client.put_objects("stream", [("o", &body, along(0.0))]).await.expect("placed");
        server.kill();
    }
    let mut killed = Instant::now();
    for round in 0..=rounds {
        let mut server = Running::start(dir.path());
        let client = server.client().await;
        let (found, revisions, stream) = look(&server, &client).await;
        for (writer, found) in writers.iter_mut().zip(found) {
            writer.settle(found, &revisions, round);
        }
        let (x, revision) = stream.expect("the scene of streamed poses");
        streamed.settle(x, revision, killed, round);
        if round == rounds {
            break;
        }

        let mut writing = Vec::new();
        for writer in writers {
            writing.push(tokio::spawn(writer.write(server.client().await)));
        }
        let streaming = tokio::spawn(streamed.write(server.client().await));
        // Every eighth time long enough for streamed poses to be written.
        let longest = if round % 8 == 7 { 1800.0 } else { 150.0 };
        tokio::time::sleep(Duration::from_secs_f64(1e-3 * longest * f64::midpoint(numbers.next(), 1.0))).await;
        assert!(server.is_running(), "round {round}: it ended by itself");
        server.kill();
        killed = Instant::now();
        writers = Vec::new();
        for writer in writing {
            writers.push(writer.await.expect("no panic"));
        }
        streamed = streaming.await.expect("no panic");
        if round % 100 == 99 {
            let acknowledged: u64 = writers.iter().map(|writer| writer.acknowledged).sum();
            println!("{} kills, {acknowledged} changes acknowledged, {} poses streamed", round + 1, streamed.sent);
        }
    }
    let acknowledged: u64 = writers.iter().map(|writer| writer.acknowledged).sum();
    println!("{rounds} kills, {acknowledged} changes acknowledged, {} poses streamed", streamed.sent);
    assert!(acknowledged > rounds && streamed.sent > rounds);
}
