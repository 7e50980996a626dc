//! What the targets in `fuzz/` call: bytes as clients and operators may send them. Compiled for
//! them only.

use std::ops::ControlFlow;
use std::sync::Arc;

use figment::Figment;
use figment::providers::{Format, Serialized, Toml};
use prost::Message;
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tonic::{Code, Request, Response, Status};

use super::app_state::AppState;
use super::bodies::Bodies;
use super::config::{Config, LimitsConfig};
use super::metrics::Metrics;
use super::proto::body_service_server::BodyService;
use super::proto::query_service_server::QueryService;
use super::proto::{
    CheckMotionsRequest, DeriveAllowedPairsRequest, LoadRobotRequest, LoadRobotResponse, UpdateSceneRequest, Verdict,
    VerifyMotionRequest, VerifyMotionResponse,
};
use super::queries::Queries;
use super::tokens::Tokens;
use super::{derive_wire, error, robot_wire, robots, scene_wire};
use crate::body::Body;
use crate::jobs;
use crate::measure::Pose;
use crate::robot::motion::PairClass;
use crate::robot::motion::fuzzing::sealed;
use crate::scene::{PlaceRobot, Placement, Scene, Update};
use crate::store::{Catalogue, DeriveOutcome, DeriveRequest, RobotSource, Store};

/// A server of one small scene with a robot, without a network.
#[derive(Debug)]
pub struct Served {
    runtime: Runtime,
    app: AppState,
    catalogue: Arc<Catalogue>,
    scene: Scene,
    _stop: watch::Sender<bool>,
    _dir: tempfile::TempDir,
}

/// Name of the scene, and of its objects.
pub const SCENE: &str = "s";

/// Names of its objects.
pub const OBJECTS: [&str; 3] = ["a", "b", "c"];

/// Name of the robot in the scene; seeds know the id that it has by its text.
pub const ROBOT: &str = "r";

/// An arm that turns about z and bends, on a post, with a frame at its end.
const URDF: &str = r#"<robot name="arm">
<link name="post"><collision><geometry><box size="0.2 0.2 0.4"/></geometry></collision></link>
<link name="upper"><collision><geometry><capsule radius="0.05" length="0.3"/></geometry></collision></link>
<link name="lower"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="tool"/>
<joint name="turn" type="continuous"><parent link="post"/><child link="upper"/><origin xyz="0 0 0.5"/><axis xyz="0 0 1"/></joint>
<joint name="bend" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0.2"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint>
<joint name="mount" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0 0 0.2"/></joint>
</robot>"#;

/// Most configurations of a path, so that a call of many paths takes a second at most.
const MOST_CONFIGURATIONS: u32 = 200;

/// Most boxes of joint values for a pair of links, so that a search takes a tenth of a second.
const MOST_BOXES: u32 = 200;

impl Served {
    /// Starts it.
    pub fn start() -> Self {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        let dir = tempfile::tempdir().expect("a directory");
        let catalogue = Catalogue::load(Store::open(dir.path()).expect("a store")).expect("a catalogue");
        let ball = Body::ball("ball", nalgebra::Vector3::zeros(), 0.1).expect("a ball");
        catalogue.create_body(ball.clone().into()).expect("stored");
        catalogue.create_scene(SCENE).expect("made");
        let placement = |(index, name): (usize, &&str)| Placement {
            name: (*name).into(),
            body: *ball.id(),
            pose: Pose::from_quaternion([index as f64, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).ok(),
            group: "".into(),
            padding_m: None,
            attachment: None,
        };
        let upserts = OBJECTS.iter().enumerate().map(placement).collect();
        let source = RobotSource { urdf: URDF.to_owned(), ..RobotSource::default() };
        let (loaded, _) = catalogue.load_robot(source).expect("a robot");
        let base = Pose::from_quaternion([0.5, 0.6, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
        let robot = PlaceRobot { name: ROBOT.into(), robot: loaded.robot.clone(), base, joints: Default::default() };
        let update = Update { upserts, robots: vec![robot], ..Update::default() };
        let scene = catalogue.update_scene(SCENE, &update).expect("placed");
        let catalogue = Arc::new(catalogue);
        let (_, loaded) = watch::channel(Some(catalogue.clone()));
        let (stop, stopping) = watch::channel(false);
        let limits = LimitsConfig { solver_threads: 1, ..LimitsConfig::default() };
        let app = AppState::new(loaded, stopping, (limits, Metrics::default())).expect("an app");
        Self { runtime, app, catalogue, scene, _stop: stop, _dir: dir }
    }

    /// The first byte says which call, the others are its message. Whatever they are, there is an
    /// answer, or a reason that is not the server's fault.
    pub fn call(&self, bytes: &[u8]) {
        let Some((kind, message)) = bytes.split_first() else { return };
        let queries = Queries(self.app.clone());
        match kind % 11 {
            0 => self.ask(message, |request| async { queries.evaluate(request).await.map(drop) }),
            1 => self.ask(message, |request| async { queries.check_states(request).await.map(drop) }),
            2 => self.ask(message, |request| async { queries.clearance(request).await.map(drop) }),
            3 => self.ask(message, |request| async { queries.cast_rays(request).await.map(drop) }),
            4 => {
                let bodies = Bodies(self.app.clone());
                self.ask(message, |request| async move { bodies.create_body(request).await.map(drop) });
            }
            5 => self.update(message),
            6 => self.check_motions(message, &queries),
            7 => self.verify_motion(message, &queries),
            8 => self.ask(message, |request| async { queries.explain(request).await.map(drop) }),
            9 => self.load_robot(message),
            _ => self.derive_allowed_pairs(message, &queries),
        }
    }

    fn ask<M, F>(&self, message: &[u8], call: impl FnOnce(Request<M>) -> F)
    where
        M: Message + Default,
        F: Future<Output = Result<(), Status>>,
    {
        let Ok(message) = M::decode(message) else { return };
        if let Err(status) = self.runtime.block_on(call(Request::new(message))) {
            check_status(&status);
        }
    }

    /// Changes the scene, and does not keep it.
    fn update(&self, message: &[u8]) {
        let Ok(request) = UpdateSceneRequest::decode(message) else { return };
        match self.updated(&request) {
            Ok(scene) => check_scene(&scene),
            Err(status) => check_status(&status),
        }
    }

    fn updated(&self, request: &UpdateSceneRequest) -> Result<Scene, Status> {
        let mut update = scene_wire::update(request)?;
        let mut robots = Vec::new();
        for id in scene_wire::placed_robot_ids(request)? {
            let loaded = self.catalogue.robot(&id).map_err(|error| error::catalogue(&error, "place_robots"))?;
            robots.push(loaded.robot.clone());
        }
        update.robots = scene_wire::placed_robots(request, robots)?;
        // Not written: a disk takes longer than all else.
        let updated = self.scene.updated(&update, |id| self.catalogue.geometry(id).ok());
        updated.map_err(|error| error::catalogue(&error.into(), "scene"))
    }

    /// Certificates of free paths hold in the scene in which they were made.
    fn check_motions(&self, message: &[u8], queries: &Queries) {
        let Ok(mut request) = CheckMotionsRequest::decode(message) else { return };
        let most = request.max_configurations.unwrap_or(MOST_CONFIGURATIONS);
        request.max_configurations = Some(most.min(MOST_CONFIGURATIONS));
        let answered = self.runtime.block_on(queries.check_motions(Request::new(request.clone())));
        let response = match answered.map(Response::into_inner) {
            Ok(response) => response,
            Err(status) => return check_status(&status),
        };
        for certificate in response.certificates.into_iter().filter(|text| !text.is_empty()) {
            let proof = VerifyMotionRequest {
                certificate,
                scene: request.scene.clone(),
                robot: request.robot.clone(),
                moving: request.moving.clone(),
                margin_m: request.margin_m,
                include_allowed: request.include_allowed,
                ..VerifyMotionRequest::default()
            };
            let verified = self.verified(proof, queries).expect("an answer");
            assert!(verified.holds, "{}", verified.reason);
        }
    }

    /// The digest is made to fit, so that the rest of what was damaged is read.
    fn verify_motion(&self, message: &[u8], queries: &Queries) {
        let Ok(mut request) = VerifyMotionRequest::decode(message) else { return };
        if let Some(certificate) = sealed(&request.certificate) {
            request.certificate = certificate;
        }
        if let Err(status) = self.verified(request, queries) {
            check_status(&status);
        }
    }

    /// Whether a certificate holds: with a clearance, or with a reason why not.
    fn verified(&self, request: VerifyMotionRequest, queries: &Queries) -> Result<VerifyMotionResponse, Status> {
        let response = self.runtime.block_on(queries.verify_motion(Request::new(request)))?.into_inner();
        let VerifyMotionResponse { holds, reason, clearance_lower_m, .. } = &response;
        assert!(*holds == reason.is_empty() && *holds != clearance_lower_m.is_nan(), "{response:?}");
        Ok(response)
    }

    /// Loads a robot, and does not store it: links come after those that they hang on, and values
    /// of joints one after the other.
    fn load_robot(&self, message: &[u8]) {
        let Ok(request) = LoadRobotRequest::decode(message) else { return };
        let links: Vec<String> = request.link_bodies.iter().map(|body| body.link.clone()).collect();
        let source = match robot_wire::source(request) {
            Ok(source) => source,
            Err(invalid) => return check_status(&invalid.into()),
        };
        let loaded = match source.load(|id| self.catalogue.geometry(id).ok()) {
            Ok(loaded) => loaded,
            Err(why) => return check_status(&robots::load_error(&why.into(), &links)),
        };
        let robot = robot_wire::robot(&loaded);
        for (place, link) in robot.links.iter().enumerate() {
            let is_before = robot.links[..place].iter().any(|before| before.name == link.parent);
            assert!(if place == 0 { link.parent.is_empty() } else { is_before }, "{robot:?}");
        }
        let firsts = robot.joints.iter().scan(0, |next, joint| Some(std::mem::replace(next, *next + joint.width)));
        assert!(firsts.eq(robot.joints.iter().map(|joint| joint.first)), "{robot:?}");
        let response = LoadRobotResponse { robot: Some(robot), created: true };
        error::fits(&response).expect("a small message");
    }

    /// Looks for links that touch as the job does, to its end, and does not keep it. What is found
    /// comes back from the wire.
    fn derive_allowed_pairs(&self, message: &[u8], queries: &Queries) {
        let Ok(mut request) = DeriveAllowedPairsRequest::decode(message) else { return };
        let most = request.max_boxes.unwrap_or(MOST_BOXES);
        request.max_boxes = Some(most.min(MOST_BOXES));
        let asked = match derive_wire::request(&request) {
            Ok((_, asked)) => asked,
            Err(invalid) => return check_status(&invalid.into()),
        };
        let loaded = match self.catalogue.robot(&asked.robot) {
            Ok(loaded) => loaded,
            Err(why) => return check_status(&error::catalogue(&why, "robot_id")),
        };
        derive_wire::check_size(&loaded).expect("a small robot");
        let found = jobs::derive(&asked, &loaded, &mut |_| ControlFlow::Continue(())).expect("a finite margin");
        // Three links have geometry.
        assert_eq!(found.pairs.len(), 3, "{found:?}");
        self.check_pairs(&asked, &found, queries);
        let sent = derive_wire::task(&asked, None, Some(&found));
        assert_eq!(sent.result.as_ref().and_then(derive_wire::outcome), Some(found));
    }

    /// What is in contact is nearer than the margin, and not proven free where it is said to be;
    /// what never is was nowhere seen that near.
    fn check_pairs(&self, asked: &DeriveRequest, found: &DeriveOutcome, queries: &Queries) {
        for pair in &found.pairs {
            assert!(pair.boxes <= asked.max_boxes, "{pair:?}");
            match pair.class {
                PairClass::Never => assert!(pair.upper_m.is_none_or(|upper| upper > asked.margin_m), "{pair:?}"),
                PairClass::Always | PairClass::Collides => {
                    assert!(pair.upper_m.is_some_and(|upper| upper < asked.margin_m), "{pair:?}");
                    let witness = pair.witness.as_deref().expect("a configuration");
                    let stays = CheckMotionsRequest {
                        scene: SCENE.into(),
                        robot: ROBOT.into(),
                        joint_values: robot_wire::numbers(&[witness, witness].concat()),
                        margin_m: asked.margin_m,
                        include_allowed: true,
                        max_configurations: Some(1),
                        ..CheckMotionsRequest::default()
                    };
                    let answered = self.runtime.block_on(queries.check_motions(Request::new(stays)));
                    let answer = answered.expect("an answer").into_inner();
                    let proven = [Verdict::Contact, Verdict::Undecided].map(|verdict| verdict as u8);
                    assert!(proven.contains(&answer.verdicts[0]), "{pair:?}: {answer:?}");
                }
                PairClass::Adjacent | PairClass::Undecided => {}
            }
        }
    }
}

/// A reason in words that is not the server's fault.
fn check_status(status: &Status) {
    let ours = [Code::Internal, Code::Unknown, Code::DataLoss];
    assert!(!ours.contains(&status.code()), "{status}");
    assert!(!status.message().is_empty() && status.message().len() < 4096, "{status}");
    // Both are sent in headers, of which clients take a few kilobytes.
    assert!(status.details().len() < 5120, "{status}");
}

/// What is held is where its holder has it, and robots have values within their limits.
fn check_scene(scene: &Scene) {
    for (_, object, pose) in scene.objects() {
        assert!(pose.translation().iter().all(|metres| metres.is_finite()), "{}", object.name);
        let Some(held) = &object.attachment else { continue };
        let holder = scene.slot(&held.to).and_then(|slot| scene.pose(slot)).expect("a holder");
        let place = held.pose.translation();
        let size = holder.translation().norm() + place.norm() + pose.translation().norm();
        let way = (holder.transform_point(place) - pose.translation()).norm();
        // Farther away, sums of squares overflow.
        assert!(way <= 1e-12 * size || size > 1e100, "{}: {way}", object.name);
    }
    for robot in scene.robots() {
        let kinematics = robot.robot().kinematics();
        assert_eq!(kinematics.check(robot.configuration()), Ok(()), "{}", robot.name());
        for (name, slot) in kinematics.links().iter().zip(robot.link_slots()) {
            let Some(slot) = slot else { continue };
            let object = scene.object(*slot).expect("a link");
            assert_eq!(*object.name, format!("{}/{name}", robot.name()));
        }
    }
}

/// A file of settings: refused with a reason, or as it is printed.
pub fn settings(text: &str) {
    let read = |text: &str| -> Result<Config, String> {
        let sources = Figment::from(Serialized::defaults(Config::default())).merge(Toml::string(text));
        let config: Config = sources.extract().map_err(|error| error.to_string())?;
        config.check().map_err(|error| error.to_string())?;
        Ok(config)
    };
    match read(text) {
        Ok(config) => assert_eq!(read(&config.to_toml()).as_ref(), Ok(&config)),
        Err(why) => assert!(!why.is_empty()),
    }
}

/// A file of tokens: refused with a reason, or with tokens that nobody finds by chance.
pub fn tokens(text: &str) {
    match Tokens::parse(text) {
        Ok(tokens) => assert!(tokens.find(text.as_bytes()).is_none()),
        Err(why) => assert!(!why.is_empty()),
    }
}
