//! Motions of robots, and their certificates.

use super::columns::{index_pairs, name, number};
use super::connection::Client;
use super::error::ClientError;
use crate::service::packed::Packed;
use crate::service::proto::{self, CheckMotionsRequest, VerifyMotionRequest, VerifyMotionResponse};

/// Many motions of one robot.
#[derive(Clone, Debug, Default)]
pub struct MotionsQuestion {
    request: CheckMotionsRequest,
    values: Packed,
    counts: Packed,
}

impl MotionsQuestion {
    /// Motions that set joints of a robot of the scene: those that are named, or all in the order
    /// of joint vectors. The others are as in the scene.
    pub fn of_robot<'a>(robot: &str, joints: impl IntoIterator<Item = &'a str>) -> Self {
        let joints = joints.into_iter().map(Into::into).collect();
        let request = CheckMotionsRequest { robot: robot.into(), joints, ..CheckMotionsRequest::default() };
        Self { request, ..Self::default() }
    }

    /// Adds a path through configurations, each the values of the joints in their order: radians,
    /// metres, unit quaternions.
    #[must_use]
    pub fn with_path<'a>(mut self, configurations: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let mut count = 0;
        for configuration in configurations {
            configuration.iter().for_each(|&value| self.values.number(value));
            count += 1;
        }
        self.counts.index(count);
        self
    }

    /// Adds the edges of a path one by one: from each configuration straight to the next.
    #[must_use]
    pub fn with_edges<Configuration: AsRef<[f64]>>(self, path: &[Configuration]) -> Self {
        path.windows(2).fold(self, |question, edge| question.with_path(edge.iter().map(AsRef::as_ref)))
    }

    /// A pair is in contact below this margin and its padding, metres.
    #[must_use]
    pub fn with_margin(mut self, margin_m: f64) -> Self {
        self.request.margin_m = margin_m;
        self
    }

    /// With certificates of the paths that are free.
    #[must_use]
    pub fn with_certificates(mut self) -> Self {
        self.request.certificates = true;
        self
    }

    fn asked(self, scene: &str) -> CheckMotionsRequest {
        let (joint_values, point_counts) = (self.values.into_bytes(), self.counts.into_bytes());
        CheckMotionsRequest { scene: scene.into(), joint_values, point_counts, ..self.request }
    }

    /// The request without its paths, for what this type does not say.
    pub fn request_mut(&mut self) -> &mut CheckMotionsRequest {
        &mut self.request
    }
}

/// What is proven of one motion.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedMotion {
    /// Whether it is free.
    pub verdict: proto::Verdict,
    /// It is proven free up to this path parameter.
    pub alpha: f64,
    /// All pairs keep at least this signed distance less their padding as far as that, metres; NaN
    /// where nothing is proven.
    pub clearance_lower_m: f64,
    /// Of a contact, or of what is open: the two objects, and the path parameter at which it was
    /// seen.
    pub contact: Option<([String; 2], f64)>,
    /// JSON text; none unless it was asked for and the motion is free.
    pub certificate: Option<String>,
}

/// Verdicts of motions.
#[derive(Clone, Debug)]
pub struct CheckedMotions {
    /// Revision all of them are true of.
    pub revision: u64,
    /// One per path.
    pub motions: Vec<CheckedMotion>,
    /// Whether every path was decided as far as its resolution.
    pub complete: bool,
}

impl CheckedMotions {
    /// Whether every path is proven free.
    pub fn are_free(&self) -> bool {
        self.verdicts().iter().all(|verdict| *verdict == proto::Verdict::Free)
    }

    /// The verdicts, one per path.
    pub fn verdicts(&self) -> Vec<proto::Verdict> {
        self.motions.iter().map(|motion| motion.verdict).collect()
    }
}

impl Client {
    /// Asks whether motions of a robot are free: whole paths, not samples.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn check_motions(&self, scene: &str, question: MotionsQuestion) -> Result<CheckedMotions, ClientError> {
        let response = self.queries().check_motions(question.asked(scene)).await.map_err(self.refused())?.into_inner();
        let verdict = |byte: u8| proto::Verdict::try_from(i32::from(byte)).unwrap_or_default();
        let table = &response.objects;
        let pairs = index_pairs(&response.pairs).map(|[a, b]| Some([name(table, a)?, name(table, b)?]));
        let rows = response.verdicts.iter().zip(pairs).enumerate().map(|(row, (&byte, pair))| CheckedMotion {
            verdict: verdict(byte),
            alpha: number(&response.alpha, row),
            clearance_lower_m: number(&response.clearance_lower_m, row),
            contact: pair.map(|pair| (pair, number(&response.contact_s, row))),
            certificate: response.certificates.get(row).filter(|text| !text.is_empty()).cloned(),
        });
        let motions: Vec<_> = rows.collect();
        if motions.len() != response.verdicts.len() {
            return Err(ClientError::Unexpected("another number of pairs than of paths"));
        }
        Ok(CheckedMotions { revision: response.scene_revision, motions, complete: response.complete })
    }

    /// Has a certificate of a motion checked.
    ///
    /// # Errors
    /// A text that is no certificate, and a scene or robot that is not there.
    pub async fn verify_motion(&self, request: VerifyMotionRequest) -> Result<VerifyMotionResponse, ClientError> {
        Ok(self.queries().verify_motion(request).await.map_err(self.refused())?.into_inner())
    }
}
