//! Messages that are too long end their call with a reason that names the limit, before they are
//! read. A message of gRPC begins with five bytes: a flag, and its length.

use std::pin::Pin;
use std::task::{Context, Poll};

use bytes::{Buf, Bytes};
use http_body::{Body as HttpBody, Frame, SizeHint};
use tonic::Status;
use tonic::body::Body;

use super::error;
use super::limits::MAX_MESSAGE_BYTES;

/// Bytes before each message.
const HEADER: usize = 5;

/// The body of a request whose messages are measured as they come.
pub(super) struct Measured {
    body: Body,
    /// What has come of the header of the next message.
    header: Vec<u8>,
    /// Bytes of the message that are still to come.
    rest: usize,
}

impl Measured {
    pub(super) fn new(body: Body) -> Self {
        Self { body, header: Vec::with_capacity(HEADER), rest: 0 }
    }

    /// Follows the messages through some bytes.
    fn follow(&mut self, mut bytes: Bytes) -> Result<(), Status> {
        while bytes.has_remaining() {
            if self.rest > 0 {
                let taken = self.rest.min(bytes.remaining());
                bytes.advance(taken);
                self.rest -= taken;
                continue;
            }
            self.header.push(bytes.get_u8());
            if let &[_, a, b, c, d] = &self.header[..] {
                let length = usize::try_from(u32::from_be_bytes([a, b, c, d])).unwrap_or(usize::MAX);
                self.header.clear();
                error::message_fits(length)?;
                self.rest = length;
            }
        }
        Ok(())
    }
}

impl HttpBody for Measured {
    type Data = Bytes;
    type Error = Status;

    fn poll_frame(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, Status>>> {
        match Pin::new(&mut self.body).poll_frame(context) {
            Poll::Ready(Some(Ok(frame))) => {
                let followed = match frame.data_ref() {
                    Some(data) => self.follow(data.clone()),
                    None => Ok(()),
                };
                Poll::Ready(Some(followed.map(|()| frame)))
            }
            other => other,
        }
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

const _: () = assert!(MAX_MESSAGE_BYTES < u32::MAX as usize);

#[cfg(test)]
mod tests {
    use super::*;

    fn message(length: u32) -> Vec<u8> {
        let mut bytes = vec![0];
        bytes.extend_from_slice(&length.to_be_bytes());
        bytes
    }

    #[test]
    fn messages_are_measured_however_they_are_cut() {
        let mut bytes = Vec::new();
        for length in [0_u32, 3, 1, 7] {
            bytes.extend(message(length));
            bytes.extend(vec![9; length as usize]);
        }
        bytes.extend(message(u32::try_from(MAX_MESSAGE_BYTES).expect("a length") + 1));
        for cut in 1..bytes.len() {
            let mut measured = Measured::new(Body::empty());
            let mut followed = Ok(());
            for piece in bytes.chunks(cut) {
                followed = followed.and_then(|()| measured.follow(piece.to_vec().into()));
            }
            let status = followed.expect_err("the last is too long");
            assert_eq!(status.code(), tonic::Code::ResourceExhausted);
            assert!(status.message().contains("max_message_bytes"), "{}", status.message());
        }
        let mut measured = Measured::new(Body::empty());
        measured.follow(bytes[..bytes.len() - 5].to_vec().into()).expect("the others are not");
    }
}
