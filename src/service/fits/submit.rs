//! The client side of `sublevel fit --server`.

use std::future::Future;

use nalgebra::Vector3;
use tonic::transport::Channel;
use tonic::{Code, Status};

use super::super::limits::{CALL_LIMIT, MAX_MESSAGE_BYTES};
use super::super::proto::body_service_client::BodyServiceClient;
use super::super::proto::create_fit_request::Part;
use super::super::proto::fit_service_client::FitServiceClient;
use super::super::proto::{
    CancelFitRequest, CreateFitRequest, FitJob, FitResult, FitState, GetBodyRequest, PointChunk, TriangleChunk,
    WatchFitRequest,
};
use super::super::push::{PushError, connect};
use super::{request, wire};
use crate::body::{Body, BodyFileError, Compound, SosBody};
use crate::jobs::{FitOutput, Shapes, body_name};
use crate::store::{FitRequest, FittedKind};

/// Points, or triangles, of one message: some 1.5 MB.
const CHUNK: usize = 1 << 16;

/// Why a server made no bodies.
#[derive(Debug, thiserror::Error)]
pub enum SubmitError {
    /// There is no server.
    #[error(transparent)]
    Connect(#[from] PushError),
    /// The server has no FitService.
    #[error("the server at {0} was built without fitting; fit without --server and `sublevel push` the bodies")]
    Unable(String),
    /// The server refused the job.
    #[error("the server did not take the job: {} ({:?})", .0.message(), .0.code())]
    Refused(Box<Status>),
    /// The job is done and its body is not there.
    #[error("the server did not give the fitted body: {} ({:?}); was it deleted meanwhile?", .0.message(), .0.code())]
    Gone(Box<Status>),
    /// The connection broke while the job was under way.
    #[error(
        "lost the server while it fitted job {id}, which goes on there when it is back: {} ({:?}); GetFit says how it ended",
        .status.message(),
        .status.code()
    )]
    Lost {
        /// The job.
        id: String,
        /// What went wrong.
        status: Box<Status>,
    },
    /// What was sent cannot be fitted.
    #[error("{0}")]
    Failed(String),
    /// The job was cancelled, here or by another client.
    #[error("the fit was cancelled")]
    Cancelled,
    /// The server sent something that is not what the job makes.
    #[error("the server sent what cannot be proven: {0}; are the versions the same?")]
    Unproven(String),
}

impl From<BodyFileError> for SubmitError {
    fn from(error: BodyFileError) -> Self {
        Self::Unproven(error.to_string())
    }
}

/// Has a server execute a request about points (metres) and the triangles between them, or about a
/// group of bodies that it has; fetches what it made and proves it again. `tell` learns of the job
/// whenever it has changed; when `cancel` resolves, the job is cancelled.
///
/// # Errors
/// [`SubmitError`].
pub async fn submit(
    url: &str,
    asked: &FitRequest,
    points: &[Vector3<f64>],
    triangles: &[[usize; 3]],
    mut tell: impl FnMut(&FitJob),
    cancel: impl Future<Output = ()>,
) -> Result<FitOutput, SubmitError> {
    let channel = connect(url, CALL_LIMIT).await?;
    let mut client = FitServiceClient::new(channel.clone())
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    tokio::pin!(cancel);
    let created = tokio::select! {
        created = client.create_fit(tokio_stream::iter(messages(asked, points, triangles))) => created,
        // What is not sent to its end makes no job.
        () = &mut cancel => return Err(SubmitError::Cancelled),
    };
    let created = created.map_err(|status| match status.code() {
        Code::Unimplemented => SubmitError::Unable(url.to_owned()),
        _ => SubmitError::Refused(Box::new(status)),
    })?;
    let mut job = created.into_inner().job.unwrap_or_default();

    let id = job.id.clone();
    let lost = |status| SubmitError::Lost { id: id.clone(), status: Box::new(status) };
    let mut watch = client.clone().watch_fit(WatchFitRequest { id: id.clone() }).await.map_err(lost)?.into_inner();
    let mut cancelling = false;
    loop {
        tokio::select! {
            heard = watch.message() => match heard.map_err(lost)?.and_then(|heard| heard.job) {
                Some(heard) => job = heard,
                None => break,
            },
            () = &mut cancel, if !cancelling => {
                cancelling = true;
                client.cancel_fit(CancelFitRequest { id: id.clone() }).await.map_err(lost)?;
            }
        }
        tell(&job);
    }
    match job.state() {
        FitState::Succeeded => {}
        FitState::Cancelled => return Err(SubmitError::Cancelled),
        _ => return Err(SubmitError::Failed(job.failure)),
    }
    fetch(channel, asked, job.result.unwrap_or_default()).await
}

/// The header, and the points and triangles in pieces, each made when it is sent.
fn messages(
    asked: &FitRequest,
    points: &[Vector3<f64>],
    triangles: &[[usize; 3]],
) -> impl Iterator<Item = CreateFitRequest> + use<> {
    let coordinates = |chunk: &[Vector3<f64>]| {
        let coordinates = chunk.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
        Part::Points(PointChunk { coordinates })
    };
    let corners = |chunk: &[[usize; 3]]| {
        // One that is too large names no point, and the server says so.
        let corner = |&corner| u32::try_from(corner).unwrap_or(u32::MAX);
        Part::Triangles(TriangleChunk { corners: chunk.iter().flatten().map(corner).collect() })
    };
    let triangles = if asked.uses_triangles() { triangles } else { &[] };
    std::iter::once(Part::Header(request::header(asked)))
        .chain(chunks(points.to_vec(), coordinates))
        .chain(chunks(triangles.to_vec(), corners))
        .map(|part| CreateFitRequest { part: Some(part) })
}

fn chunks<T>(all: Vec<T>, part: impl Fn(&[T]) -> Part) -> impl Iterator<Item = Part> {
    (0..all.len()).step_by(CHUNK).map(move |from| part(&all[from..all.len().min(from + CHUNK)]))
}

/// What a job made, re-proven here from the server's files.
async fn fetch(channel: Channel, asked: &FitRequest, result: FitResult) -> Result<FitOutput, SubmitError> {
    let unknown = || SubmitError::Unproven("something of a kind that this program does not know".to_owned());
    let outcome = wire::outcome(&result).ok_or_else(unknown)?;
    let file = || text(&result.bodies[0].file_json);
    let shapes = match outcome.bodies.first().map(|made| made.kind) {
        Some(FittedKind::Compound) => Shapes::Compound(Box::new(Compound::from_json(file()?)?)),
        Some(FittedKind::SosBody) => Shapes::SosBody(Box::new(SosBody::from_json(file()?)?)),
        _ => {
            let mut client = BodyServiceClient::new(channel).max_decoding_message_size(MAX_MESSAGE_BYTES);
            let mut bodies = Vec::new();
            for (index, made) in outcome.bodies.iter().enumerate() {
                let found = client.get_body(GetBodyRequest { id: made.id.clone() }).await;
                let found = found.map_err(|status| SubmitError::Gone(Box::new(status)))?.into_inner();
                let body = Body::from_json(text(&found.body_file_json)?)?;
                // The server may have had it under another name.
                let named = body.renamed(&body_name(asked, index));
                bodies.push(named.map_err(|error| SubmitError::Unproven(error.to_string()))?);
            }
            Shapes::Bodies(bodies)
        }
    };
    Ok(FitOutput { outcome, shapes })
}

fn text(file: &[u8]) -> Result<&str, SubmitError> {
    std::str::from_utf8(file).map_err(|error| SubmitError::Unproven(error.to_string()))
}
