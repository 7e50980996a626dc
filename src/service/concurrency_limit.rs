//! One limit before all calls of the services (FitService, whose uploads take long, has one of its
//! own): what is behind it holds messages in memory, what is before it does not.
//!
//! A call that waits here has not been read: HTTP/2's flow control keeps its message with the
//! client. Health and reflection do not pass the limit, so they are answered however many calls
//! wait.

use std::convert::Infallible;
use std::sync::Arc;
use std::task::{Context, Poll};

use tokio::sync::Semaphore;
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::{BoxFuture, Service, http};
use tonic::server::NamedService;

use super::call_time::{CallTime, Deadline, until};
use super::error;
use super::limits::{CALL_LIMIT, MAX_CALLS};
use super::message_limit::Measured;

/// Makes services share one limit.
#[derive(Debug, Clone)]
pub(super) struct ConcurrencyLimit(Arc<Semaphore>);

/// A service behind the limit.
#[derive(Debug, Clone)]
pub(super) struct Limited<S> {
    inner: S,
    limit: ConcurrencyLimit,
}

impl ConcurrencyLimit {
    pub(super) fn new() -> Self {
        Self(Arc::new(Semaphore::new(MAX_CALLS)))
    }

    pub(super) fn before<S>(&self, inner: S) -> Limited<S> {
        Limited { inner, limit: self.clone() }
    }
}

impl<S: NamedService> NamedService for Limited<S> {
    const NAME: &'static str = S::NAME;
}

impl<S> Service<http::Request<Body>> for Limited<S>
where
    S: Service<http::Request<Body>, Response = http::Response<Body>, Error = Infallible> + Clone + Send + 'static,
    S::Future: Send,
{
    type Response = http::Response<Body>;
    type Error = Infallible;
    type Future = BoxFuture<Self::Response, Infallible>;

    fn poll_ready(&mut self, context: &mut Context<'_>) -> Poll<Result<(), Infallible>> {
        self.inner.poll_ready(context)
    }

    fn call(&mut self, request: http::Request<Body>) -> Self::Future {
        // Generated services are always ready, so the clone is as ready as the original.
        let (mut inner, limit) = (self.inner.clone(), self.limit.0.clone());
        // Now: it may take a while until the future is polled.
        let deadline = CallTime::deadline(request.headers());
        Box::pin(async move {
            let path = request.uri().path().to_owned();
            let _permit = tokio::select! {
                permit = limit.acquire_owned() => permit,
                () = until(deadline) => return Ok(error::deadline().into_http()),
            };
            let mut request = request.map(|body| Body::new(Measured::new(body)));
            if let Some(deadline) = deadline {
                request.extensions_mut().insert(Deadline(deadline));
            }
            // A message that never comes to its end would keep its place for ever.
            let answer = tokio::time::timeout(CALL_LIMIT, inner.call(request));
            let response = tokio::select! {
                biased;
                answer = answer => answer.unwrap_or_else(|_| Ok(error::too_slow(CALL_LIMIT).into_http()))?,
                () = until(deadline) => error::deadline().into_http(),
            };
            if let Some(status) = Status::from_header_map(response.headers()) {
                tracing::debug!(call = path, code = ?status.code(), why = status.message(), "refused");
            }
            Ok(response)
        })
    }
}
