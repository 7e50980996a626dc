//! Certificates of motions: whether they prove what they say.

use super::connection::Client;
use super::error::ClientError;
use super::motions::moving_objects;
use crate::measure::Pose;
use crate::service::proto::{VerifyMotionRequest, VerifyMotionResponse};

/// A certificate of a free motion, to be checked by itself or against a scene.
#[derive(Clone, Debug, Default)]
pub struct CertificateQuestion {
    request: VerifyMotionRequest,
}

impl CertificateQuestion {
    /// A certificate as [`CheckedMotion`](super::CheckedMotion) has it, JSON text, by itself.
    pub fn new(certificate: impl Into<String>) -> Self {
        Self { request: VerifyMotionRequest { certificate: certificate.into(), ..VerifyMotionRequest::default() } }
    }

    /// It has to be about this robot among the objects of this scene as they are.
    #[must_use]
    pub fn of_robot(mut self, scene: &str, robot: &str) -> Self {
        (self.request.scene, self.request.robot) = (scene.into(), robot.into());
        self
    }

    /// And of this margin, metres; only of a robot in a scene.
    #[must_use]
    pub fn with_margin(mut self, margin_m: f64) -> Self {
        self.request.margin_m = margin_m;
        self
    }

    /// And of these objects that move meanwhile, as in
    /// [`MotionsQuestion::with_moving`](super::MotionsQuestion::with_moving); only of a robot in a
    /// scene.
    #[must_use]
    pub fn with_moving<'a>(mut self, moving: impl IntoIterator<Item = (&'a str, [Pose; 2])>) -> Self {
        self.request.moving = Some(moving_objects(moving));
        self
    }

    /// The request, for what this type does not say.
    pub fn request_mut(&mut self) -> &mut VerifyMotionRequest {
        &mut self.request
    }
}

/// What came of the check of a certificate.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedCertificate {
    /// Revision of the scene that it was compared with; none without a scene.
    pub revision: Option<u64>,
    /// What it proves of its path, or in words why it proves nothing.
    pub proof: Result<ProvenMotion, String>,
}

/// What a certificate proves of its path: that it is free.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProvenMotion {
    /// All pairs keep at least this signed distance less their padding, metres; infinity without
    /// pairs.
    pub clearance_lower_m: f64,
    /// Configurations at which the robot was placed, a count.
    pub configurations: u32,
}

impl CheckedCertificate {
    /// Whether the certificate proves its path free.
    pub fn holds(&self) -> bool {
        self.proof.is_ok()
    }
}

impl Client {
    /// Has a certificate of a motion checked, without a solver.
    ///
    /// # Errors
    /// A text that is no certificate, and a scene or robot that is not there. A certificate that
    /// does not hold is an answer.
    pub async fn verify_motion(&self, question: CertificateQuestion) -> Result<CheckedCertificate, ClientError> {
        let response = self.queries().verify_motion(question.request).await.map_err(self.refused())?.into_inner();
        read(response)
    }
}

fn read(response: VerifyMotionResponse) -> Result<CheckedCertificate, ClientError> {
    let VerifyMotionResponse { holds, reason, clearance_lower_m, configurations, scene_revision } = response;
    if holds && clearance_lower_m.is_nan() {
        return Err(ClientError::unreadable("clearance_lower_m", "is NaN of a certificate that holds"));
    }
    Ok(CheckedCertificate {
        revision: Some(scene_revision).filter(|&revision| revision > 0),
        proof: if holds { Ok(ProvenMotion { clearance_lower_m, configurations }) } else { Err(reason) },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_proof_without_its_clearance_is_none() {
        let good = VerifyMotionResponse { holds: true, configurations: 3, scene_revision: 7, ..Default::default() };
        let proof = ProvenMotion { clearance_lower_m: 0.0, configurations: 3 };
        assert_eq!(read(good.clone()).expect("read"), CheckedCertificate { revision: Some(7), proof: Ok(proof) });
        let error = read(VerifyMotionResponse { clearance_lower_m: f64::NAN, ..good }).expect_err("unreadable");
        assert_eq!(error.field().as_deref(), Some("clearance_lower_m"));
        let bad = VerifyMotionResponse { reason: "why".into(), clearance_lower_m: f64::NAN, ..Default::default() };
        assert_eq!(read(bad).expect("read"), CheckedCertificate { revision: None, proof: Err("why".into()) });
    }
}
