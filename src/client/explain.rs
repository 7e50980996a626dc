//! Why a state is in contact, and what frees it.

use super::connection::Client;
use super::error::ClientError;
use crate::service::packed::Packed;
use crate::service::proto::{ExplainRequest, ExplainResponse};

impl Client {
    /// Asks why a robot of a scene is in contact at values of some of its joints, or of all if none
    /// is named; without values as it stands in the scene. A pair is in contact below `margin_m`,
    /// metres, and its padding.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn explain<'a>(
        &self,
        scene: &str,
        robot: &str,
        joints: impl IntoIterator<Item = &'a str>,
        values: &[f64],
        margin_m: f64,
    ) -> Result<ExplainResponse, ClientError> {
        let mut packed = Packed::with_capacity(8 * values.len());
        values.iter().for_each(|&value| packed.number(value));
        self.explain_state(ExplainRequest {
            scene: scene.into(),
            robot: robot.into(),
            joints: joints.into_iter().map(Into::into).collect(),
            joint_values: packed.into_bytes(),
            margin_m,
            ..ExplainRequest::default()
        })
        .await
    }

    /// The same with everything that the protocol knows, for states of objects, too.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn explain_state(&self, request: ExplainRequest) -> Result<ExplainResponse, ClientError> {
        Ok(self.queries().explain(request).await.map_err(self.refused())?.into_inner())
    }
}
