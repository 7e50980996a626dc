//! Real server processes on loopback, and clients for them.

use std::io::{BufRead, BufReader, Read};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};

use sublevel::body::Body;
use sublevel::client::Client;
use sublevel::service::proto::blob_service_client::BlobServiceClient;
use sublevel::service::proto::body_service_client::BodyServiceClient;
use sublevel::service::proto::create_body_request::Source;
use sublevel::service::proto::evaluate_request::Question;
#[cfg(feature = "fit")]
use sublevel::service::proto::fit_service_client::FitServiceClient;
#[cfg(feature = "fit")]
use sublevel::service::proto::hierarchy_service_client::HierarchyServiceClient;
#[cfg(feature = "fit")]
use sublevel::service::proto::job_service_client::JobServiceClient;
use sublevel::service::proto::query_service_client::QueryServiceClient;
use sublevel::service::proto::robot_service_client::RobotServiceClient;
use sublevel::service::proto::scene_service_client::SceneServiceClient;
use sublevel::service::proto::{
    self, CreateBodyRequest, CreateSceneRequest, EvaluateRequest, GetSceneRequest, GetSceneResponse, Object,
    ObjectPair, ObjectPose, PairList, Pose, PoseTable, Quaternion, Subject, SubjectPair, UpdateSceneRequest, Vector3,
    subject,
};
use tonic::transport::{Channel, Endpoint};
use tonic_types::StatusExt;

/// Longest time that anything may take before it counts as hung. No test compares times.
pub(crate) const PATIENCE: Duration = Duration::from_secs(120);

pub(crate) fn ball(radius: f64) -> Body {
    Body::ball("ball", nalgebra::Vector3::zeros(), radius).expect("a ball")
}

/// A server that ends with the test, whatever the test does.
pub(crate) struct Running {
    child: Child,
    pub(crate) addr: SocketAddr,
}

pub(crate) fn command(dir: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel"));
    command.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(dir);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).env("RUST_LOG", "info");
    command
}

impl Running {
    pub(crate) fn start(dir: &Path) -> Self {
        Self::spawn(command(dir))
    }

    /// With so few file descriptors, and all it logs in a file in the directory.
    pub(crate) fn start_limited(dir: &Path, descriptors: u32) -> Self {
        let mut limited = Command::new("sh");
        limited.args(["-c", &format!("ulimit -n {descriptors}; exec \"$0\" \"$@\"")]);
        limited.arg(env!("CARGO_BIN_EXE_sublevel")).args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(dir);
        let log = std::fs::File::create(dir.join("log")).expect("a log");
        limited.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(log).env("RUST_LOG", "sublevel=debug");
        Self::spawn(limited)
    }

    /// What a server that was started with a log has said.
    pub(crate) fn log(dir: &Path) -> String {
        std::fs::read_to_string(dir.join("log")).expect("a log")
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Most memory it ever took.
    pub(crate) fn peak_memory_mib(&self) -> u64 {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.child.id())).expect("it runs");
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("a peak");
        peak.trim().trim_end_matches(" kB").parse::<u64>().expect("a number") / 1024
    }

    /// Seconds of work it has done on all cores.
    pub(crate) fn cpu(&self) -> f64 {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).expect("it runs");
        let fields: Vec<_> = stat.rsplit(')').next().expect("fields").split_whitespace().collect();
        // User and system time in ticks, a hundred a second.
        fields[11..13].iter().map(|ticks| ticks.parse::<f64>().expect("a number")).sum::<f64>() / 100.0
    }

    pub(crate) fn spawn(mut command: Command) -> Self {
        let mut child = command.spawn().expect("the server starts");
        let mut line = String::new();
        let stdout = child.stdout.as_mut().expect("stdout is piped");
        BufReader::new(stdout).read_line(&mut line).expect("a first line");
        let addr = line.strip_prefix("listening on ").map(|addr| addr.trim_end().parse());
        let Some(Ok(addr)) = addr else {
            let _ = child.kill();
            let _ = child.wait();
            panic!("the first line is {line:?}");
        };
        Self { child, addr }
    }

    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.addr)
    }

    pub(crate) async fn connect(&self) -> Clients {
        let endpoint = Endpoint::from_shared(self.url()).expect("a url").tcp_nodelay(true);
        let channel = endpoint.connect().await.expect("the server answers");
        Clients {
            bodies: BodyServiceClient::new(channel.clone()),
            robots: RobotServiceClient::new(channel.clone()),
            scenes: SceneServiceClient::new(channel.clone()),
            queries: QueryServiceClient::new(channel.clone()),
            #[cfg(feature = "fit")]
            fits: FitServiceClient::new(channel.clone()),
            #[cfg(feature = "fit")]
            hierarchy: HierarchyServiceClient::new(channel.clone()),
            #[cfg(feature = "fit")]
            jobs: JobServiceClient::new(channel.clone()),
            blobs: BlobServiceClient::new(channel.clone()),
            channel,
            url: self.url(),
        }
    }

    /// The typed client.
    pub(crate) async fn client(&self) -> Client {
        Client::connect(&self.url()).await.expect("the server answers")
    }

    /// SIGKILL: no time to tidy up.
    pub(crate) fn is_running(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|status| status.is_none())
    }

    pub(crate) fn kill(mut self) {
        self.child.kill().expect("killed");
        self.child.wait().expect("waited for");
    }

    /// SIGTERM.
    pub(crate) fn terminate(&self) {
        self.signal("-TERM");
    }

    /// SIGINT, as Ctrl-C sends it.
    pub(crate) fn interrupt(&self) {
        self.signal("-INT");
    }

    pub(crate) fn signal(&self, name: &str) {
        let pid = self.child.id().to_string();
        assert!(Command::new("kill").args([name, &pid]).status().expect("kill runs").success());
    }

    /// Waits for the end, at most [`PATIENCE`].
    pub(crate) fn wait(&mut self) -> ExitStatus {
        let start = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().expect("waited for") {
                let mut rest = String::new();
                self.child.stdout.take().expect("stdout is piped").read_to_string(&mut rest).expect("text");
                assert_eq!(rest, "", "stdout holds the first line only");
                return status;
            }
            assert!(start.elapsed() < PATIENCE, "still running after {PATIENCE:?}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub(crate) fn run(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sublevel")).args(args).stdin(Stdio::null()).output().expect("the command runs")
}

pub(crate) struct Clients {
    pub(crate) bodies: BodyServiceClient<Channel>,
    pub(crate) robots: RobotServiceClient<Channel>,
    pub(crate) scenes: SceneServiceClient<Channel>,
    pub(crate) queries: QueryServiceClient<Channel>,
    #[cfg(feature = "fit")]
    pub(crate) fits: FitServiceClient<Channel>,
    #[cfg(feature = "fit")]
    pub(crate) hierarchy: HierarchyServiceClient<Channel>,
    #[cfg(feature = "fit")]
    pub(crate) jobs: JobServiceClient<Channel>,
    pub(crate) blobs: BlobServiceClient<Channel>,
    pub(crate) channel: Channel,
    /// Where the server is.
    pub(crate) url: String,
}

impl Clients {
    /// Stores a body and returns its id.
    pub(crate) async fn put(&mut self, body: &Body) -> String {
        self.put_file(body.to_json()).await
    }

    /// Stores the body of a file of any kind and returns its id.
    pub(crate) async fn put_file(&mut self, file: String) -> String {
        self.bodies
            .create_body(body_file(file.into_bytes()))
            .await
            .expect("stored")
            .into_inner()
            .body
            .expect("a body")
            .id
    }

    pub(crate) async fn make_scene(&mut self, name: &str) -> u64 {
        let response = self.scenes.create_scene(CreateSceneRequest { name: name.into() }).await.expect("a scene");
        response.into_inner().scene.expect("a scene").revision
    }

    pub(crate) async fn update(&mut self, update: UpdateSceneRequest) -> u64 {
        self.scenes.update_scene(update).await.expect("updated").into_inner().revision
    }

    /// A scene that fits in one page.
    pub(crate) async fn scene(&mut self, name: &str) -> GetSceneResponse {
        let request = GetSceneRequest { name: name.into(), page_size: 10_000, page_token: String::new() };
        self.scenes.get_scene(request).await.expect("a scene").into_inner()
    }

    pub(crate) async fn revision(&mut self, name: &str) -> u64 {
        self.scene(name).await.scene.expect("a summary").revision
    }
}

pub(crate) fn pose(translation: [f64; 3], rotation: [f64; 4]) -> Pose {
    let [x, y, z] = translation;
    let translation_m = Some(Vector3 { x, y, z });
    let [x, y, z, w] = rotation;
    Pose { translation_m, rotation: Some(Quaternion { x, y, z, w }) }
}

pub(crate) fn at(x: f64) -> Pose {
    pose([x, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
}

pub(crate) fn object(name: &str, body_id: &str, pose: Pose) -> Object {
    Object { name: name.into(), body_id: body_id.into(), pose: Some(pose), ..Default::default() }
}

pub(crate) fn moved(name: &str, pose: Pose) -> ObjectPose {
    ObjectPose { name: name.into(), pose: Some(pose) }
}

pub(crate) fn pair(a: &str, b: &str) -> ObjectPair {
    ObjectPair { a: a.into(), b: b.into() }
}

/// Poses as plain rows.
pub(crate) fn rows(rows: Vec<ObjectPose>) -> Option<PoseTable> {
    Some(PoseTable { rows, ..PoseTable::default() })
}

/// Two objects by name, for rules.
pub(crate) fn subjects(a: &str, b: &str) -> SubjectPair {
    let object = |name: &str| Some(Subject { subject: Some(subject::Subject::Object(name.into())) });
    SubjectPair { a: object(a), b: object(b) }
}

pub(crate) fn body_file(file: Vec<u8>) -> CreateBodyRequest {
    CreateBodyRequest { name: String::new(), source: Some(Source::File(file.into())) }
}

/// Measures of pairs of the scene `room`, with everything that is known of them.
pub(crate) fn question(pairs: Vec<ObjectPair>, measures: &[sublevel::service::proto::Measure]) -> EvaluateRequest {
    let outputs = [
        proto::Output::Value,
        proto::Output::Witnesses,
        proto::Output::Normal,
        proto::Output::Gradients,
        proto::Output::Flags,
        proto::Output::Parts,
        proto::Output::Solver,
        proto::Output::Objects,
    ];
    EvaluateRequest {
        scene: "room".into(),
        question: Some(Question::Pairs(PairList { rows: pairs, ..PairList::default() })),
        measures: measures.iter().map(|&measure| measure.into()).collect(),
        outputs: outputs.map(i32::from).to_vec(),
        ..EvaluateRequest::default()
    }
}

/// Every number of a pose, bit for bit.
pub(crate) fn bits(pose: &Pose) -> [u64; 7] {
    let (t, r) = (pose.translation_m.as_ref().expect("t"), pose.rotation.as_ref().expect("r"));
    [t.x, t.y, t.z, r.x, r.y, r.z, r.w].map(f64::to_bits)
}

/// The field a refusal names first.
pub(crate) fn field(status: &tonic::Status) -> String {
    let details = status.get_error_details();
    let violation = details.bad_request().and_then(|bad| bad.field_violations.first());
    violation.map(|violation| violation.field.clone()).unwrap_or_default()
}

/// The machine-readable reason of a refusal.
pub(crate) fn reason(status: &tonic::Status) -> String {
    status.get_error_details().error_info().map(|info| info.reason.clone()).unwrap_or_default()
}

/// A small generator of test numbers in [-1, 1) that use all their bits.
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let mixed = (self.0 ^ (self.0 >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        ((mixed >> 11) as f64) / (1u64 << 52) as f64 - 1.0
    }

    pub(crate) fn pose(&mut self) -> Pose {
        let mut q = [0.0; 4];
        let mut norm: f64 = 0.0;
        while !(0.1..=1.0).contains(&norm) {
            q = [(); 4].map(|()| self.next());
            norm = q.iter().map(|q| q * q).sum::<f64>().sqrt();
        }
        pose([(); 3].map(|()| 3.0 * self.next()), q.map(|q| q / norm))
    }
}
