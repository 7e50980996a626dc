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
    CancelFitRequest, CreateFitRequest, FitJob, FitState, FittedBody, GetBodyRequest, PointChunk, WatchFitRequest,
};
use super::super::push::{PushError, connect};
use super::wire;
use crate::body::Body;
use crate::store::FitOrder;

/// Points of one message: some 1.5 MB.
const CHUNK: usize = 1 << 16;

/// What a server made.
#[derive(Debug)]
pub struct Submitted {
    /// The job in its final state.
    pub job: FitJob,
    /// Its bodies and what they took, re-proven here from the server's files.
    pub bodies: Vec<(FittedBody, Body)>,
}

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
        "lost the server while it fitted job {id}, which goes on there when it is back: {} ({:?}); GetFit tells how it ended",
        .status.message(),
        .status.code()
    )]
    Lost {
        /// The job.
        id: String,
        /// What went wrong.
        status: Box<Status>,
    },
    /// The points can not be fitted.
    #[error("{0}")]
    Failed(String),
    /// The job was cancelled, here or by another client.
    #[error("the fit was cancelled")]
    Cancelled,
    /// The server sent something that is no body.
    #[error("the server sent a body that can not be proven: {0}; are the versions the same?")]
    Unproven(String),
}

/// Has a server fit points (metres), and fetches the bodies. `tell` hears of the job whenever it has changed; when `cancel`
/// resolves, the job is cancelled.
///
/// # Errors
/// [`SubmitError`].
pub async fn submit(
    url: &str,
    order: &FitOrder,
    points: &[Vector3<f64>],
    mut tell: impl FnMut(&FitJob),
    cancel: impl Future<Output = ()>,
) -> Result<Submitted, SubmitError> {
    let channel = connect(url, CALL_LIMIT).await?;
    let mut client = FitServiceClient::new(channel.clone()).max_encoding_message_size(MAX_MESSAGE_BYTES);
    tokio::pin!(cancel);
    let created = tokio::select! {
        created = client.create_fit(tokio_stream::iter(messages(order, points))) => created,
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
    let mut bodies = Vec::new();
    for fitted in job.result.clone().unwrap_or_default().bodies {
        let body = fetch(channel.clone(), &fitted.body_id).await?;
        bodies.push((fitted, body));
    }
    Ok(Submitted { job, bodies })
}

/// The header and the points in pieces, each made when it is sent.
fn messages(order: &FitOrder, points: &[Vector3<f64>]) -> impl Iterator<Item = CreateFitRequest> + use<> {
    let header = CreateFitRequest { part: Some(Part::Header(wire::header(order))) };
    let points = points.to_vec();
    let chunks = (0..points.len()).step_by(CHUNK).map(move |from| {
        let chunk = &points[from..points.len().min(from + CHUNK)];
        let coordinates = chunk.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
        CreateFitRequest { part: Some(Part::Points(PointChunk { coordinates })) }
    });
    std::iter::once(header).chain(chunks)
}

async fn fetch(channel: Channel, id: &str) -> Result<Body, SubmitError> {
    let mut client = BodyServiceClient::new(channel).max_decoding_message_size(MAX_MESSAGE_BYTES);
    let file = client
        .get_body(GetBodyRequest { id: id.to_owned() })
        .await
        .map_err(|status| SubmitError::Gone(Box::new(status)))?;
    let file = file.into_inner().body_file_json;
    let text = std::str::from_utf8(&file).map_err(|error| SubmitError::Unproven(error.to_string()))?;
    Body::from_json(text).map_err(|error| SubmitError::Unproven(error.to_string()))
}
