//! What the targets in `fuzz/` call: bytes as clients and operators may send them. Compiled for
//! them only.

use std::sync::Arc;

use figment::Figment;
use figment::providers::{Format, Serialized, Toml};
use prost::Message;
use tokio::runtime::Runtime;
use tokio::sync::watch;
use tonic::{Code, Request, Status};

use super::app_state::AppState;
use super::bodies::Bodies;
use super::config::{Config, LimitsConfig};
use super::metrics::Metrics;
use super::proto::body_service_server::BodyService;
use super::proto::query_service_server::QueryService;
use super::queries::Queries;
use super::scene_wire;
use super::tokens::Tokens;
use crate::body::Body;
use crate::measure::Pose;
use crate::scene::{Placement, Scene, Update};
use crate::store::{Catalogue, Store};

/// A server of one small scene, without a network.
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
        let scene = catalogue.update_scene(SCENE, &Update { upserts, ..Update::default() }).expect("placed");
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
        match kind % 6 {
            0 => self.ask(message, |request| async { queries.evaluate(request).await.map(drop) }),
            1 => self.ask(message, |request| async { queries.check_states(request).await.map(drop) }),
            2 => self.ask(message, |request| async { queries.clearance(request).await.map(drop) }),
            3 => self.ask(message, |request| async { queries.cast_rays(request).await.map(drop) }),
            4 => {
                let bodies = Bodies(self.app.clone());
                self.ask(message, |request| async move { bodies.create_body(request).await.map(drop) });
            }
            _ => {
                let Ok(request) = super::proto::UpdateSceneRequest::decode(message) else { return };
                let Ok(update) = scene_wire::update(&request) else { return };
                // Not written: a disk takes longer than all else.
                let _ = self.scene.updated(&update, |id| self.catalogue.geometry(id).ok());
            }
        }
    }

    fn ask<M, F>(&self, message: &[u8], call: impl FnOnce(Request<M>) -> F)
    where
        M: Message + Default,
        F: Future<Output = Result<(), Status>>,
    {
        let Ok(message) = M::decode(message) else { return };
        let answered = self.runtime.block_on(call(Request::new(message)));
        if let Err(status) = answered {
            let ours = [Code::Internal, Code::Unknown, Code::DataLoss];
            assert!(!ours.contains(&status.code()), "{status}");
            assert!(!status.message().is_empty() && status.message().len() < 4096, "{status}");
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
