//! Certificates of free motions: what is claimed, and what proves it.
//!
//! A certificate contains the robot, its path, all bodies and obstacles with their polynomials, the
//! pairs that do not count, and for each pair that does a list of intervals that cover the path. On
//! each, planes across a unit vector keep the pieces apart by more than these can move. A reader
//! needs neither the scene nor a solver.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::certificate_error::CertificateError;
use super::claim::{DigestedClaim, hexadecimal};
use super::interval::Interval;
use super::path::Path;
use super::placing::Placing;
use super::planes::{Height, Tangent, gap};
use super::problem::MotionProblem;

/// The format that is written and read. Floating joints moved along lines in the first, and move as
/// screws in this one: its paths are other curves.
pub(crate) const FORMAT: &str = "sublevel motion certificate 2";

/// What all formats of certificates begin with.
const FAMILY: &str = "sublevel motion certificate";

/// Proof that a motion is free, to be stored beside a plan.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    pub(crate) format: String,
    pub(crate) claim: Arc<DigestedClaim>,
    pub(crate) path: Path,
    pub(crate) records: Vec<Record>,
    /// SHA-256 of the JSON text of all of the above, with the digest of the claim in its place,
    /// hexadecimal.
    pub(crate) digest: String,
}

/// What keeps one pair of pieces apart on one interval.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Record {
    pub(crate) interval: Interval,
    /// Position of the pair.
    pub(crate) pair: u32,
    /// Unit vector from the second piece to the first in the middle of the interval, world frame.
    pub(crate) normal: [f64; 3],
    pub(crate) proof: Proof,
}

/// How far the pieces reach along the normal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Proof {
    /// As far as their balls.
    Balls,
    /// As far as their tables or closed forms say.
    Planes,
    /// As support points prove; none: as the closed form says.
    Tangents(Box<[Option<Tangent>; 2]>),
}

impl Certificate {
    pub(crate) fn new(problem: &MotionProblem, path: &Path, records: Vec<Record>) -> Self {
        let (format, claim) = (FORMAT.to_owned(), problem.claim().clone());
        let mut certificate = Self { format, claim, path: path.clone(), records, digest: String::new() };
        certificate.digest = certificate.computed_digest();
        certificate
    }

    /// As text.
    pub fn to_json(&self) -> String {
        // Finite numbers, strings and lists of these: it cannot fail.
        serde_json::to_string(self).unwrap_or_default()
    }

    /// From text; the digest is checked, and nothing else yet, see [`Certificate::verify`].
    ///
    /// # Errors
    /// A text of another format, and a digest that does not fit.
    pub fn from_json(text: &str) -> Result<Self, CertificateError> {
        let certificate: Self =
            serde_json::from_str(text).map_err(|error| CertificateError::Format(error.to_string()))?;
        if certificate.format != FORMAT {
            let found = format!("its format is {:?}, not {FORMAT:?}", certificate.format);
            return Err(CertificateError::Format(found));
        }
        if certificate.digest != certificate.computed_digest() {
            return Err(CertificateError::Digest);
        }
        if !certificate.path.is_whole() {
            return Err(CertificateError::Format("its path holds no whole configurations".to_owned()));
        }
        Ok(certificate)
    }

    /// Whether a text says that it is a certificate.
    pub fn is_file(text: &str) -> bool {
        #[derive(Deserialize)]
        struct Head {
            format: String,
        }
        serde_json::from_str::<Head>(text).is_ok_and(|head| head.format.starts_with(FAMILY))
    }

    /// The path that is claimed to be free.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Signed distance that all pairs are claimed to keep, less their padding, metres.
    pub fn margin_m(&self) -> f64 {
        self.claim.margin_m
    }

    /// Number of records.
    pub fn records(&self) -> usize {
        self.records.len()
    }

    pub(crate) fn computed_digest(&self) -> String {
        let parts = (&self.format, self.claim.digest(), &self.path, &self.records);
        hexadecimal(&Sha256::digest(serde_json::to_vec(&parts).unwrap_or_default()))
    }
}

impl Record {
    /// Lower bound of the signed distance of the pair over the interval that `placing` is set to,
    /// metres; minus infinity if the record proves none. A bound that `is_enough` is as good as the
    /// largest one that the record proves, which takes twice as long.
    pub(crate) fn lower_m(
        &self,
        problem: &MotionProblem,
        placing: &mut Placing,
        is_enough: impl FnOnce(f64) -> bool,
    ) -> f64 {
        let n = nalgebra::Vector3::from(self.normal);
        let Some(pair) = problem.pairs.get(self.pair as usize) else { return f64::NEG_INFINITY };
        let Some(placed) = placing.pair(problem, pair) else { return f64::NEG_INFINITY };
        // Not `>`: a NaN is refused, too.
        if !((n.norm() - 1.0).abs() <= UNIT) {
            return f64::NEG_INFINITY;
        }
        let heights = match &self.proof {
            Proof::Balls => [Height::Ball; 2],
            Proof::Planes => [Height::Table; 2],
            Proof::Tangents(of) => of.each_ref().map(|tangent| tangent.as_ref().map_or(Height::Table, Height::Tangent)),
        };
        let [a, b] = pair.pieces.map(|piece| problem.piece(piece).1);
        let gap = gap((&a, &placed[0].pose, heights[0]), (&b, &placed[1].pose, heights[1]), &n);
        let here = gap - placed[0].error_m() - placed[1].error_m();
        let approach = placing.approach_m(pair, &placed);
        let lower = here - approach;
        if is_enough(lower) {
            return lower;
        }
        let lower = here - approach.min(placing.approach_along_m(pair, &placed, &n));
        if lower.is_nan() { f64::NEG_INFINITY } else { lower }
    }
}

/// How far the length of a normal may be from 1: what computing it leaves.
const UNIT: f64 = 8.0 * f64::EPSILON;
