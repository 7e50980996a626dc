//! The answer of a call while it is sent: how it ends is counted, and a stream ends when its token
//! is revoked.

use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Instant;

use bytes::Bytes;
use http_body::{Frame, SizeHint};
use tonic::body::Body;
use tonic::codegen::http::HeaderMap;
use tonic::{Code, Status};

use super::metrics::{Metrics, Open};

/// Messages and trailers of an answer.
pub(super) struct AnswerBody {
    inner: Body,
    ending: Option<Ending>,
    revoked: Option<Revoked>,
}

/// Resolves when the call may not go on.
pub(super) type Revoked = Pin<Box<dyn Future<Output = Status> + Send>>;

impl AnswerBody {
    pub(super) fn new(inner: Body, ending: Ending, revoked: Option<Revoked>) -> Self {
        Self { inner, ending: Some(ending), revoked }
    }

    /// Without a status clients see UNKNOWN.
    fn end(&mut self, status: Option<&Status>) {
        self.revoked = None;
        if let Some(mut ending) = self.ending.take() {
            ending.code = status.map_or(Code::Unknown, Status::code);
            if let Some(status) = status.filter(|status| status.code() != Code::Ok) {
                tracing::debug!(call = ending.call, code = name(status.code()), why = status.message(), "ended");
            }
        }
    }
}

impl http_body::Body for AnswerBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if let Some(Poll::Ready(status)) = self.revoked.as_mut().map(|revoked| revoked.as_mut().poll(context)) {
            // Who makes the answer learns that nobody reads it any more.
            self.inner = Body::empty();
            let mut trailers = HeaderMap::new();
            status.add_header(&mut trailers)?;
            self.end(Some(&status));
            return Poll::Ready(Some(Ok(Frame::trailers(trailers))));
        }
        let frame = Pin::new(&mut self.inner).poll_frame(context);
        match &frame {
            Poll::Ready(Some(Ok(frame))) => {
                if let Some(trailers) = frame.trailers_ref() {
                    self.end(Status::from_header_map(trailers).as_ref());
                }
            }
            Poll::Ready(Some(Err(status))) => self.end(Some(status)),
            Poll::Ready(None) => self.end(None),
            Poll::Pending => {}
        }
        frame
    }

    fn is_end_stream(&self) -> bool {
        self.revoked.is_none() && self.inner.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        if self.revoked.is_some() { SizeHint::default() } else { self.inner.size_hint() }
    }
}

/// Counts a call when it is dropped: as cancelled unless it ended before.
pub(super) struct Ending {
    metrics: Metrics,
    call: &'static str,
    begun: Instant,
    pub(super) code: Code,
    _open: Open,
}

impl Ending {
    /// Of a call that begins now.
    pub(super) fn new(metrics: Metrics, call: &'static str) -> Self {
        let open = metrics.begun();
        Self { metrics, call, begun: Instant::now(), code: Code::Cancelled, _open: open }
    }

    /// When the call began.
    pub(super) fn begun(&self) -> Instant {
        self.begun
    }
}

impl Drop for Ending {
    fn drop(&mut self) {
        self.metrics.ended(self.call, name(self.code), self.begun.elapsed());
    }
}

/// A code as gRPC writes it.
pub(super) fn name(code: Code) -> &'static str {
    match code {
        Code::Ok => "OK",
        Code::Cancelled => "CANCELLED",
        Code::Unknown => "UNKNOWN",
        Code::InvalidArgument => "INVALID_ARGUMENT",
        Code::DeadlineExceeded => "DEADLINE_EXCEEDED",
        Code::NotFound => "NOT_FOUND",
        Code::AlreadyExists => "ALREADY_EXISTS",
        Code::PermissionDenied => "PERMISSION_DENIED",
        Code::ResourceExhausted => "RESOURCE_EXHAUSTED",
        Code::FailedPrecondition => "FAILED_PRECONDITION",
        Code::Aborted => "ABORTED",
        Code::OutOfRange => "OUT_OF_RANGE",
        Code::Unimplemented => "UNIMPLEMENTED",
        Code::Internal => "INTERNAL",
        Code::Unavailable => "UNAVAILABLE",
        Code::DataLoss => "DATA_LOSS",
        Code::Unauthenticated => "UNAUTHENTICATED",
    }
}
