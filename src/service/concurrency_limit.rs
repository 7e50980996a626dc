//! One limit before all calls of the services (those that make and follow jobs, whose uploads take
//! long, have one of their own): what is behind it holds messages in memory, what is before it does
//! not.
//!
//! A call that waits here has not been read: HTTP/2's flow control keeps its message with the
//! client. Health and reflection do not pass the limit, so they are answered however many calls
//! wait.

use std::convert::Infallible;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use tokio::sync::Semaphore;
use tonic::body::Body;
use tonic::codegen::{BoxFuture, Service, http};
use tonic::server::NamedService;

use super::call_time::{CallTime, Deadline, until};
use super::config::LimitsConfig;
use super::error;
use super::message_limit::Measured;
use super::metrics::Metrics;

/// Makes services share one limit.
#[derive(Debug, Clone)]
pub(super) struct ConcurrencyLimit {
    places: Arc<Semaphore>,
    /// Longest time that a call waits for its place.
    queue: Duration,
    /// Longest time from then to its answer.
    call: Duration,
    metrics: Metrics,
}

/// A service behind the limit.
#[derive(Debug, Clone)]
pub(super) struct Limited<S> {
    inner: S,
    limit: ConcurrencyLimit,
}

impl ConcurrencyLimit {
    pub(super) fn new(limits: &LimitsConfig, metrics: Metrics) -> Self {
        let places = Arc::new(Semaphore::new(limits.calls));
        Self { places, queue: limits.queue(), call: limits.call(), metrics }
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
        let (mut inner, limit) = (self.inner.clone(), self.limit.clone());
        let begun = Instant::now();
        // Now: it may take a while until the future is polled.
        let deadline = CallTime::deadline(request.headers());
        Box::pin(async move {
            let _permit = tokio::select! {
                biased;
                permit = limit.places.acquire_owned() => permit,
                () = until(deadline) => return Ok(error::deadline().into_http()),
                () = tokio::time::sleep(limit.queue) => {
                    limit.metrics.queued(begun.elapsed(), true);
                    return Ok(error::shed(limit.queue).into_http());
                }
            };
            limit.metrics.queued(begun.elapsed(), false);
            let mut request = request.map(|body| Body::new(Measured::new(body)));
            if let Some(deadline) = deadline {
                request.extensions_mut().insert(Deadline(deadline));
            }
            // A message that never comes to its end would keep its place for ever.
            let answer = tokio::time::timeout(limit.call, inner.call(request));
            tokio::select! {
                biased;
                answer = answer => answer.unwrap_or_else(|_| Ok(error::too_slow(limit.call).into_http())),
                () = until(deadline) => Ok(error::deadline().into_http()),
            }
        })
    }
}
