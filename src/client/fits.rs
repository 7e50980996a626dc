//! Fits made by a server.

use std::future::Future;

use nalgebra::Vector3;

use super::connection::Client;
use super::error::ClientError;
use super::jobs::{JobProgress, SubmitError};
use crate::body::{BodyId, Shape};
use crate::jobs::{FitOutput, Shapes, body_name};
use crate::scene::Geometry;
use crate::service::fits::{request, wire};
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto::create_fit_request::Source;
use crate::service::proto::fit_points::{Coordinates, Corners};
use crate::service::proto::fit_service_client::FitServiceClient;
use crate::service::proto::job::Task;
use crate::service::proto::{FitPoints, Job};
use crate::store::FitRequest;

/// What does not fit in one message with what is around it.
const LARGE: usize = MAX_MESSAGE_BYTES / 4;

impl Client {
    /// Has the server execute a request about points (metres) and the triangles between them, or
    /// about a group of bodies that it has; fetches what it made and proves it again. `tell` learns
    /// of the job whenever it has changed; when `cancel` resolves, the job is cancelled.
    ///
    /// # Errors
    /// [`SubmitError`].
    pub async fn fit(
        &self,
        asked: &FitRequest,
        (points, triangles): (&[Vector3<f64>], &[[usize; 3]]),
        mut tell: impl FnMut(&JobProgress),
        cancel: impl Future<Output = ()>,
    ) -> Result<FitOutput, SubmitError> {
        tokio::pin!(cancel);
        let mut message = request::message(asked);
        if asked.group().is_none() {
            message.source = Some(Source::Points(self.points(asked, points, triangles).await?));
        }
        let mut client = FitServiceClient::new(self.channel());
        let created = tokio::select! {
            created = client.create_fit(message) => created,
            // What is not sent to its end makes no job.
            () = &mut cancel => return Err(SubmitError::Cancelled),
        };
        let id = created.map_err(|status| self.not_queued(status))?.into_inner().job_id;
        let tell = |job: &Job| tell(&JobProgress::of(&id, job));
        let job = self.follow(&id, tell, cancel).await?;
        self.fetch(asked, job).await
    }

    async fn points(
        &self,
        asked: &FitRequest,
        points: &[Vector3<f64>],
        triangles: &[[usize; 3]],
    ) -> Result<FitPoints, ClientError> {
        let coordinates: Vec<u8> = points.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        // One that is too large names no point, and the server says so.
        let corner = |&corner: &usize| u32::try_from(corner).unwrap_or(u32::MAX).to_le_bytes();
        let triangles = if asked.uses_triangles() { triangles } else { &[] };
        let corners: Vec<u8> = triangles.iter().flatten().flat_map(corner).collect();
        let coordinates = if coordinates.len() > LARGE {
            Coordinates::PointsBlobId(self.upload(&coordinates).await?)
        } else {
            Coordinates::Points(coordinates.into())
        };
        let corners = match corners.len() {
            0 => None,
            bytes if bytes > LARGE => Some(Corners::TrianglesBlobId(self.upload(&corners).await?)),
            _ => Some(Corners::Triangles(corners.into())),
        };
        Ok(FitPoints { coordinates: Some(coordinates), corners })
    }

    /// What a job made, re-proven here from the server's files.
    async fn fetch(&self, asked: &FitRequest, job: Job) -> Result<FitOutput, SubmitError> {
        let result = match job.task {
            Some(Task::Fit(fit)) => fit.result.unwrap_or_default(),
            _ => return Err(SubmitError::Unproven("nothing".into())),
        };
        let unknown = || SubmitError::Unproven("something of a kind that this program does not know".into());
        let outcome = wire::outcome(&result).ok_or_else(unknown)?;
        let mut bodies = Vec::new();
        for (index, made) in outcome.bodies.iter().enumerate() {
            let id: BodyId = made.id.parse().map_err(|_| unknown())?;
            match self.body(&id).await? {
                Geometry::Solid(shape) => match &*shape {
                    // The server may have had it under another name.
                    Shape::Body(body) => {
                        let named = body.renamed(&body_name(asked, index));
                        bodies.push(named.map_err(|error| SubmitError::Unproven(error.to_string()))?);
                    }
                    Shape::Compound(compound) => {
                        let shapes = Shapes::Compound(compound.clone());
                        return Ok(FitOutput { outcome, shapes, ladder: None });
                    }
                },
                Geometry::SosBody(body) => {
                    let shapes = Shapes::SosBody(Box::new((*body).clone()));
                    return Ok(FitOutput { outcome, shapes, ladder: None });
                }
                Geometry::Ladder(_) | Geometry::Capsule(_) | Geometry::HalfSpace(_) => return Err(unknown()),
            }
        }
        let ladder = match &outcome.ladder {
            Some(id) => match self.body(&id.parse().map_err(|_| unknown())?).await? {
                Geometry::Ladder(ladder) => Some(ladder),
                _ => return Err(unknown()),
            },
            None => None,
        };
        Ok(FitOutput { outcome, shapes: Shapes::Bodies(bodies), ladder })
    }
}
