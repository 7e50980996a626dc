//! A typed client: domain types in and out. The command line, the demo, tests and users share it.
//!
//! ```no_run
//! # async fn run() -> Result<(), Box<dyn std::error::Error>> {
//! use nalgebra::Vector3;
//! use sublevel::client::{Client, Question};
//! use sublevel::measure::Pose;
//! use sublevel::scene::query::Measure;
//!
//! let client = Client::connect("http://127.0.0.1:50051").await?;
//! let ball = client.create_ball("ball", 0.1).await?;
//! client.create_scene("cell").await?;
//! let at = |x: f64| Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]);
//! client.put_objects("cell", [("a", &ball, at(0.0)?), ("b", &ball, at(0.5)?)]).await?;
//! let answers = client.evaluate("cell", Question::pairs([("a", "b")]), &[Measure::Distance]).await?;
//! assert!((answers.rows[0].value.unwrap_or(f64::NAN) - 0.3).abs() < 1e-8);
//! # Ok(())
//! # }
//! ```

mod backup;
mod bodies;
mod certificates;
mod clearance;
mod columns;
mod connection;
#[cfg(feature = "fit")]
mod derive;
mod error;
mod explain;
#[cfg(feature = "fit")]
mod fits;
#[cfg(feature = "fit")]
mod hierarchy;
#[cfg(feature = "fit")]
mod jobs;
mod motions;
mod pose_stream;
mod queries;
mod raw;
mod robot_files;
mod robots;
mod scenes;
mod states;

pub use bodies::{BodySource, StoredBody};
pub use certificates::{CertificateQuestion, CheckedCertificate, ProvenMotion};
pub use clearance::{ClearanceQuestion, Clearances, NearPair, StateClearance};
pub use connection::{Client, ClientOptions, Connection, Credentials, ServerInfo, endpoint};
pub use error::ClientError;
pub use explain::{ExplainQuestion, ExplainedPair, ExplainedState};
#[cfg(feature = "fit")]
pub use jobs::{JobProgress, SubmitError};
pub use motions::{CheckedMotion, CheckedMotions, MotionsQuestion};
pub use pose_stream::{PoseStream, StreamedPoses};
pub use queries::{Answers, PairRow, Question};
pub use robot_files::{RobotFiles, RobotFilesError};
pub use robots::{ListedRobot, RobotPlacement, StoredGroup, StoredGroupState, StoredLink, StoredRobot};
pub use scenes::{ListedScene, SceneState};
pub use states::{CheckedStates, StatesQuestion};
