//! One query of a family, and what came of it.

use super::zoo::ZooError;
use crate::comparison::PeerError;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::fmt;
use sublevel::body::Body;
use sublevel::measure::{OptionsError, Pose, PoseError};

/// Two bodies at their poses whose distance is asked for.
#[derive(Clone, Debug)]
pub(super) struct Case {
    pub(super) a: Body,
    pub(super) pose_a: Pose,
    pub(super) b: Body,
    pub(super) pose_b: Pose,
    /// Accuracy asked for, relative to the smaller body.
    pub(super) accuracy: f64,
    /// Most iterations, where the family is about that.
    pub(super) limit: Option<u32>,
    /// The distance, metres, where it is known.
    pub(super) exact: Option<f64>,
    /// Largest error of our answers, metres, where the family asks for more than a true bracket.
    pub(super) bound: Option<f64>,
    /// Largest width, metres, that the bracket of a case below the rounding floor may keep; it must
    /// say so then.
    pub(super) floor: f64,
    /// What the case is, for people.
    pub(super) what: String,
}

impl Case {
    /// At the default accuracy, with nothing known.
    pub(super) fn new(a: &Body, pose_a: Pose, b: &Body, pose_b: Pose, what: String) -> Self {
        let accuracy = sublevel::measure::DEFAULT_ACCURACY;
        let what = format!("{}-{} {what}", a.name(), b.name());
        let (a, b) = (a.clone(), b.clone());
        Self { a, pose_a, b, pose_b, accuracy, limit: None, exact: None, bound: None, floor: 0.0, what }
    }

    /// Bodies, poses, our answer and the truth, for people.
    pub(super) fn describe(&self) -> String {
        let Self { a, pose_a, b, pose_b, accuracy, what, .. } = self;
        let placed = |body: &Body, pose: &Pose| {
            let sizes =
                body.normalization().linear.try_inverse().map_or(Vector3::zeros(), |inverse| inverse.diagonal());
            let (t, q) = (pose.translation(), pose.rotation().coords);
            format!("{} of half-axes {sizes:?} m at {t:?} m, quaternion {q:?}", body.name())
        };
        let answer =
            self.ours(super::Method::Cold).map_or_else(|error| error.to_string(), |answer| format!("{answer:?}"));
        let truth = self.truth(&[]).map_or_else(|error| error.to_string(), |truth| format!("{truth:?}"));
        format!(
            "  {what}, accuracy {accuracy:e}\n  {}\n  {}\n  ours, cold: {answer}\n  {truth}",
            placed(a, pose_a),
            placed(b, pose_b)
        )
    }

    /// Circumradius of the smaller body, metres.
    pub(super) fn small(&self) -> f64 {
        self.a.circumscribed().radius.min(self.b.circumscribed().radius)
    }

    /// Circumradius of the larger body, metres.
    pub(super) fn large(&self) -> f64 {
        self.a.circumscribed().radius.max(self.b.circumscribed().radius)
    }
}

/// What came of a case.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Verdict {
    /// As it should be.
    Pass,
    /// The answer is off by this much: in units of the smaller body, or whatever the family
    /// compares.
    Off(f64),
    /// It claims to be what it is not.
    WrongStatus(String),
    /// It says that there is no answer.
    NoAnswer,
    /// It took longer than the limit, and was stopped.
    Hang,
    /// It ended its process by a signal or a panic.
    Crash,
}

impl Verdict {
    /// What it is in a word or two.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Off(_) => "off",
            Self::WrongStatus(_) => "wrong status",
            Self::NoAnswer => "no answer",
            Self::Hang => "hang",
            Self::Crash => "crash",
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Pass => f.write_str("passes"),
            Self::Off(error) => write!(f, "off by {error:.1e}"),
            Self::WrongStatus(what) => write!(f, "wrong status: {what}"),
            Self::NoAnswer => f.write_str("no answer"),
            Self::Hang => f.write_str("hangs"),
            Self::Crash => f.write_str("crashes"),
        }
    }
}

/// Why a case cannot even be put.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum CaseError {
    /// A body.
    #[error(transparent)]
    Zoo(#[from] ZooError),
    /// A pose.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Options of a query.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A peer's program crashed, which is a verdict on it.
    #[error("{0}")]
    Crashed(String),
    /// What else there is.
    #[error("{0}")]
    Other(String),
}

impl CaseError {
    /// An error that says enough by its words.
    pub(super) fn other(error: impl std::error::Error) -> Self {
        Self::Other(error.to_string())
    }
}

impl From<PeerError> for CaseError {
    fn from(error: PeerError) -> Self {
        match error {
            PeerError::Crashed { .. } => Self::Crashed(error.to_string()),
            PeerError::NoProgram { .. } | PeerError::Io { .. } | PeerError::Program { .. } => Self::other(error),
        }
    }
}
