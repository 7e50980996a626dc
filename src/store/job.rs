//! What a job is, as it is kept: JSON.

use std::fmt;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::derive::{DeriveOutcome, DeriveRequest};
use super::hierarchy::{HierarchyOutcome, HierarchyRequest};
use super::request::FitRequest;
use crate::body::{Solver, SolverStep};
use crate::robot::counted;

/// Most jobs that may wait; fits keep their points on disk.
pub const MAX_QUEUED_JOBS: usize = 64;

/// Jobs that are kept after they ended, the latest; with the oldest of them its request id is
/// forgotten.
pub const MAX_ENDED_JOBS: usize = 1000;

/// Longest request id.
pub const MAX_REQUEST_ID_BYTES: usize = 128;

/// A job that is not stored yet.
#[derive(Clone, Debug)]
pub struct NewJob {
    pub(super) request_id: String,
    pub(super) digest: String,
    pub(super) task: JobTask,
    /// Coordinates of the points of a fit, metres, as little-endian f64.
    pub(super) coordinates: Vec<u8>,
    /// Corners of the triangles between them as little-endian u32.
    pub(super) corners: Vec<u8>,
}

/// A job and how far it came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Job {
    /// Grows from job to job.
    pub id: u64,
    /// What the client calls its request; empty when it does not say.
    pub request_id: String,
    /// SHA-256 of the request, and of the points and triangles of a fit.
    pub digest: String,
    /// What it is asked for.
    pub task: JobTask,
    /// How often it was begun.
    pub attempts: u32,
    /// Where it is.
    pub state: JobState,
}

/// What a job is asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobTask {
    /// A fit.
    Fit(FitTask),
    /// A solve of the hierarchy.
    Hierarchy(HierarchyRequest),
    /// Pairs of links of a robot.
    Derive(DeriveRequest),
}

/// Kinds of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobKind {
    /// A fit.
    Fit,
    /// A solve of the hierarchy.
    Hierarchy,
    /// Pairs of links of a robot.
    Derive,
}

impl JobKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Fit, Self::Hierarchy, Self::Derive];

    /// Its name, as operators read it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fit => "fit",
            Self::Hierarchy => "hierarchy",
            Self::Derive => "derive",
        }
    }
}

impl JobTask {
    /// What kind of job it is.
    pub fn kind(&self) -> JobKind {
        match self {
            Self::Fit(_) => JobKind::Fit,
            Self::Hierarchy(_) => JobKind::Hierarchy,
            Self::Derive(_) => JobKind::Derive,
        }
    }
}

/// A fit that is a job.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitTask {
    /// What it is asked for.
    pub request: FitRequest,
    /// How many points were sent.
    pub points: usize,
}

/// Where a job is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// It waits for its turn.
    Queued,
    /// It is being worked on.
    Running,
    /// What it made is stored.
    Succeeded(JobOutcome),
    /// It cannot be done, for this reason.
    Failed(String),
    /// A client cancelled it.
    Cancelled,
}

/// What a job made or found; of the kind of its task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JobOutcome {
    /// Of a fit.
    Fit(FitOutcome),
    /// Of a solve of the hierarchy.
    Hierarchy(HierarchyOutcome),
    /// Of pairs of links.
    Derive(DeriveOutcome),
}

/// What a fit made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitOutcome {
    /// The bodies, coarsest first; or the one compound or sos-body.
    pub bodies: Vec<FittedBody>,
    /// Id of the ladder that the bodies make, if they do.
    #[serde(default, skip_serializing_if = "is_default")]
    pub ladder: Option<String>,
    /// Points that were left out.
    pub left_out: usize,
    /// Largest distance of one of them from the hull of the others, metres.
    pub left_out_m: f64,
}

/// What a fit made, and what that took.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedBody {
    /// What it is.
    #[serde(default, skip_serializing_if = "is_default")]
    pub kind: FittedKind,
    /// Its id.
    pub id: String,
    /// Proven bound of how far it reaches beyond the hull, metres, where there is one.
    pub gap_m: Option<f64>,
    /// Mean of that over directions, metres; only of bodies.
    pub mean_gap_m: Option<f64>,
    /// Time of the fit.
    pub seconds: f64,
    /// Only of polynomials that a program made.
    pub optimum: Option<FitOptimum>,
    /// Which bodies of the group are inside, by their positions in it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub members: Vec<usize>,
    /// Why a compound has fewer parts than were asked for, if it has. Messages do not carry it.
    #[serde(default, skip_serializing_if = "is_default")]
    pub shortfall: Option<String>,
}

/// What a fit can make.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FittedKind {
    /// A convex body.
    #[default]
    Body,
    /// A union of bodies.
    Compound,
    /// A set that need not be convex.
    SosBody,
}

/// The end of the program that made a polynomial.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitOptimum {
    /// Optimal value of the objective.
    pub objective_value: f64,
    /// It minus its lower bound from the dual, if there is one.
    pub optimality_gap: Option<f64>,
    /// Why the refinement ended, if there was one.
    pub refinement_end: Option<String>,
    /// What solved it; none in jobs of before there was a choice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solver: Option<Solver>,
    /// Why the solver that was tried first did not, if one was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fallback: Option<String>,
    /// The iterations of clarabel, of all programs; values are finite.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub log: Vec<SolverStep>,
}

impl NewJob {
    /// A fit of points, metres, that are finite, and the triangles between them; of a group of
    /// neither.
    pub fn fit(request_id: String, request: FitRequest, points: &[Vector3<f64>], triangles: &[[u32; 3]]) -> Self {
        let coordinates: Vec<u8> = points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let corners: Vec<u8> = triangles.iter().flatten().flat_map(|corner| corner.to_le_bytes()).collect();
        // What the hash reads has one form only: fields in their order, shortest numbers.
        let mut asked = serde_json::to_string(&request).unwrap_or_default();
        if !triangles.is_empty() {
            asked += &format!("{} triangles", triangles.len());
        }
        let hash = Sha256::new().chain_update(asked).chain_update(&coordinates).chain_update(&corners);
        let task = JobTask::Fit(FitTask { request, points: points.len() });
        Self { request_id, digest: hex(hash), task, coordinates, corners }
    }

    /// A solve of the hierarchy.
    pub fn hierarchy(request_id: String, request: HierarchyRequest) -> Self {
        Self::of(request_id, JobTask::Hierarchy(request))
    }

    /// Pairs of links of a robot.
    pub fn derive(request_id: String, request: DeriveRequest) -> Self {
        Self::of(request_id, JobTask::Derive(request))
    }

    fn of(request_id: String, task: JobTask) -> Self {
        let digest = hex(Sha256::new().chain_update(serde_json::to_string(&task).unwrap_or_default()));
        Self { request_id, digest, task, coordinates: Vec::new(), corners: Vec::new() }
    }
}

fn hex(hash: Sha256) -> String {
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl JobState {
    /// Whether nothing changes it any more.
    pub fn is_final(&self) -> bool {
        !matches!(self, Self::Queued | Self::Running)
    }
}

/// For logs: one line.
impl fmt::Display for JobState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Queued => f.write_str("queued"),
            Self::Running => f.write_str("running"),
            Self::Succeeded(JobOutcome::Fit(outcome)) => {
                write!(f, "succeeded with {}", counted(outcome.bodies.len(), "body", "bodies"))
            }
            Self::Succeeded(JobOutcome::Hierarchy(HierarchyOutcome { lower, upper: Some(upper), .. })) => {
                write!(f, "succeeded with the bracket {lower:e} to {upper:e}")
            }
            Self::Succeeded(JobOutcome::Hierarchy(HierarchyOutcome { lower, upper: None, .. })) => {
                write!(f, "succeeded with the lower bound {lower:e}")
            }
            Self::Succeeded(JobOutcome::Derive(outcome)) => {
                write!(f, "succeeded with {}", counted(outcome.pairs.len(), "pair", "pairs"))
            }
            Self::Failed(why) => write!(f, "failed: {why}"),
            Self::Cancelled => f.write_str("cancelled"),
        }
    }
}

/// For logs: one line.
impl fmt::Display for JobTask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fit(FitTask { request, points }) => {
                write!(f, "fit \"{}\" of {}", request.name, counted(*points, "point", "points"))
            }
            Self::Hierarchy(HierarchyRequest { sets: [a, b], level, .. }) => {
                write!(f, "hierarchy of bodies {} and {} at level {level}", a.body, b.body)
            }
            Self::Derive(DeriveRequest { robot, .. }) => write!(f, "pairs of links of robot {robot}"),
        }
    }
}
