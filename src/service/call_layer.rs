//! What every call passes first: its id, who makes it, and what is counted of it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Poll};
use std::time::{SystemTime, UNIX_EPOCH};

use http_body::Body as _;
use tonic::body::Body;
use tonic::codegen::{BoxFuture, Service, http};
use tonic::{Code, Status};
use tower::Layer;
use tracing::Instrument;

use super::answer_body::{AnswerBody, Ending, Revoked, name};
use super::authorization::Authorization;
use super::calls;
use super::metrics::Metrics;
use super::request_body::RequestBody;

/// Metadata with the id of a call: the client's, or one that is given to it.
const REQUEST_ID: &str = "x-request-id";

/// Longest id that is taken from a client.
const LONGEST_ID: usize = 64;

/// Checks, names and counts calls.
#[derive(Clone, Debug)]
pub(super) struct CallLayer {
    authorization: Authorization,
    metrics: Metrics,
    next_id: Arc<AtomicU64>,
}

impl CallLayer {
    pub(super) fn new(authorization: Authorization, metrics: Metrics) -> Self {
        // Ids of one run are in order, and those of two runs differ.
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let first = since.as_nanos() as u64;
        Self { authorization, metrics, next_id: Arc::new(AtomicU64::new(first)) }
    }

    /// The client's id if it can be printed, else a new one.
    fn id(&self, request: &http::Request<Body>) -> http::HeaderValue {
        let named = request.headers().get(REQUEST_ID);
        let usable = |id: &&http::HeaderValue| {
            let bytes = id.as_bytes();
            (1..=LONGEST_ID).contains(&bytes.len()) && bytes.iter().all(u8::is_ascii_graphic)
        };
        match named.filter(usable) {
            Some(id) => id.clone(),
            None => {
                let id = format!("{:016x}", self.next_id.fetch_add(1, Ordering::Relaxed));
                http::HeaderValue::from_str(&id).unwrap_or(http::HeaderValue::from_static("?"))
            }
        }
    }
}

impl<S> Layer<S> for CallLayer {
    type Service = Watched<S>;

    fn layer(&self, inner: S) -> Watched<S> {
        Watched { inner, layer: self.clone() }
    }
}

/// A service behind the layer.
#[derive(Clone, Debug)]
pub(super) struct Watched<S> {
    inner: S,
    layer: CallLayer,
}

impl<S> Service<http::Request<Body>> for Watched<S>
where
    S: Service<http::Request<Body>, Response = http::Response<Body>>,
    S::Future: Send + 'static,
{
    type Response = S::Response;
    type Error = S::Error;
    type Future = BoxFuture<S::Response, S::Error>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), S::Error>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        let (id, path) = (self.layer.id(&request), request.uri().path());
        let (call, is_stream) = (calls::label(path), calls::is_stream(path));
        let ending = Ending::new(self.layer.metrics.clone(), call);
        let span = tracing::info_span!("call", id = id.to_str().unwrap_or_default(), call);
        let answering = self.layer.authorization.check(&request).map(|admission| {
            let request = match admission.client() {
                Some(_) if is_stream => {
                    let revoked = Box::pin(admission.clone().revoked());
                    request.map(|body| Body::new(RequestBody::new(body, revoked)))
                }
                _ => request,
            };
            (admission, self.inner.call(request))
        });
        let answered = async move {
            // Whole, so that it ends with the call.
            let mut ending = ending;
            let (mut response, admission) = match answering {
                Ok((admission, answering)) => {
                    tracing::trace!(client = admission.client(), "begun");
                    (answering.await?, Some(admission))
                }
                Err(status) => (status.into_http(), None),
            };
            response.headers_mut().insert(REQUEST_ID, id);
            let took = ending.begun().elapsed();
            let status = Status::from_header_map(response.headers());
            match status.filter(|status| status.code() != Code::Ok) {
                Some(status) => {
                    ending.code = status.code();
                    tracing::debug!(code = name(status.code()), ?took, why = status.message(), "refused");
                    Ok(response)
                }
                None if response.body().is_end_stream() => {
                    ending.code = Code::Ok;
                    Ok(response)
                }
                None => {
                    tracing::debug!(code = "OK", ?took, "answered");
                    let revoked =
                        admission.filter(|_| is_stream).map(|admission| -> Revoked { Box::pin(admission.revoked()) });
                    Ok(response.map(|body| Body::new(AnswerBody::new(body, ending, revoked))))
                }
            }
        };
        Box::pin(answered.instrument(span))
    }
}
