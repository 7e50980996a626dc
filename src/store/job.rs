//! What a fit job is, as it is kept: JSON that any later version can read.

use std::fmt;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// Most jobs that may wait; each keeps its points on disk.
pub const MAX_QUEUED_JOBS: usize = 64;

/// Jobs that are kept after they ended, the latest; with the oldest of them its request id is forgotten.
pub const MAX_ENDED_JOBS: usize = 1000;

/// Longest request id.
pub const MAX_REQUEST_ID_BYTES: usize = 128;

/// What a job is asked for. `jobs` checks it before it is stored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitOrder {
    /// Name of the bodies to be made.
    pub name: String,
    /// Where the points are from, for their provenance; may be empty.
    pub input: String,
    /// Degree of the polynomial, or the highest tried; the default when there is none.
    pub degree: Option<usize>,
    /// Name of what is minimised.
    pub objective: String,
    /// Whether to minimise the volume itself afterwards.
    pub refine: bool,
    /// Most slabs to cut the body by.
    pub slabs: usize,
    /// Whether to fit every rung.
    pub ladder: bool,
    /// How far the body may reach beyond the hull, metres, if that is what matters.
    pub max_gap_m: Option<f64>,
    /// Fraction of the points to leave out.
    pub trim: f64,
    /// Thickness of points that have less, metres.
    pub min_thickness_m: Option<f64>,
    /// Metres per unit of the coordinates that were sent.
    pub scale: f64,
}

/// A job that is not stored yet.
#[derive(Clone, Debug)]
pub struct NewJob {
    pub(super) request_id: String,
    pub(super) digest: String,
    pub(super) order: FitOrder,
    pub(super) points: usize,
    /// Coordinates of the points, metres, as little-endian f64.
    pub(super) coordinates: Vec<u8>,
}

/// A job and how far it came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Job {
    /// Grows from job to job.
    pub id: u64,
    /// What the client calls its request; empty when it does not say.
    pub request_id: String,
    /// SHA-256 of the order and the points.
    pub digest: String,
    /// What it is asked for.
    pub order: FitOrder,
    /// How many points were sent.
    pub points: usize,
    /// How often it was begun.
    pub attempts: u32,
    /// Where it is.
    pub state: JobState,
}

/// Where a job is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// It waits for its turn.
    Queued,
    /// It is being fitted.
    Running,
    /// Its bodies are stored.
    Succeeded(FitOutcome),
    /// It can not be done, for this reason.
    Failed(String),
    /// A client cancelled it.
    Cancelled,
}

/// What a job made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitOutcome {
    /// The bodies, coarsest first.
    pub bodies: Vec<FittedBody>,
    /// Points that were left out.
    pub left_out: usize,
    /// Largest distance of one of them from the hull of the others, metres.
    pub left_out_m: f64,
}

/// A body that a job made, and what it took.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FittedBody {
    /// Its id.
    pub id: String,
    /// Proven bound of how far it reaches beyond the hull, metres.
    pub gap_m: f64,
    /// Mean of that over directions, metres.
    pub mean_gap_m: f64,
    /// Time of the fit.
    pub seconds: f64,
    /// Only of polynomials.
    pub optimum: Option<FitOptimum>,
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
}

impl NewJob {
    /// A job about points, metres, that are finite.
    pub fn new(request_id: String, order: FitOrder, points: &[Vector3<f64>]) -> Self {
        let coordinates: Vec<u8> = points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        // What the hash reads has one form only: fields in their order, shortest numbers.
        let asked = serde_json::to_string(&order).unwrap_or_default();
        let hash = Sha256::new().chain_update(asked).chain_update(&coordinates).finalize();
        let digest = hash.iter().map(|byte| format!("{byte:02x}")).collect();
        Self { request_id, digest, order, points: points.len(), coordinates }
    }
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
            Self::Succeeded(outcome) => write!(f, "succeeded with {} bodies", outcome.bodies.len()),
            Self::Failed(why) => write!(f, "failed: {why}"),
            Self::Cancelled => f.write_str("cancelled"),
        }
    }
}
