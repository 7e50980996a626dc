//! The messages of a stream while they are received: they end when the token of the call is
//! revoked, also where its client reads no answers.

use std::pin::Pin;
use std::task::{Context, Poll};

use bytes::Bytes;
use http_body::Frame;
use tonic::Status;
use tonic::body::Body;

use super::answer_body::Revoked;

/// Messages of a stream.
pub(super) struct RequestBody {
    inner: Body,
    revoked: Revoked,
    ended: bool,
}

impl RequestBody {
    pub(super) fn new(inner: Body, revoked: Revoked) -> Self {
        Self { inner, revoked, ended: false }
    }
}

impl http_body::Body for RequestBody {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        if self.ended {
            return Poll::Ready(None);
        }
        if let Poll::Ready(status) = self.revoked.as_mut().poll(context) {
            self.ended = true;
            return Poll::Ready(Some(Err(status)));
        }
        Pin::new(&mut self.inner).poll_frame(context)
    }
}
