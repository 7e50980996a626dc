//! Messages that are written already.

use bytes::{Buf, BufMut, Bytes};
use tonic::Status;
use tonic::client::Grpc;
use tonic::codec::{Codec, DecodeBuf, Decoder, EncodeBuf, Encoder};
use tonic::codegen::http::uri::PathAndQuery;

use super::connection::Client;
use super::error::ClientError;

impl Client {
    /// Makes a call, such as `QueryService/Evaluate`, with a message as protobuf writes it; returns
    /// the bytes of the answer.
    pub(crate) async fn raw(&self, call: &str, message: Bytes) -> Result<usize, ClientError> {
        let path = PathAndQuery::try_from(format!("/sublevel.v1.{call}"));
        let path = path.map_err(|error| self.refused()(Status::invalid_argument(error.to_string())))?;
        let mut grpc = Grpc::new(self.channel());
        grpc.ready().await.map_err(|error| self.refused()(Status::unavailable(error.to_string())))?;
        let answer = grpc.unary(tonic::Request::new(message), path, Raw).await.map_err(self.refused())?;
        Ok(answer.get_ref().len())
    }
}

/// Bytes as they are.
#[derive(Clone, Copy, Debug, Default)]
struct Raw;

impl Codec for Raw {
    type Encode = Bytes;
    type Decode = Bytes;
    type Encoder = Self;
    type Decoder = Self;

    fn encoder(&mut self) -> Self {
        *self
    }

    fn decoder(&mut self) -> Self {
        *self
    }
}

impl Encoder for Raw {
    type Item = Bytes;
    type Error = Status;

    fn encode(&mut self, item: Bytes, to: &mut EncodeBuf<'_>) -> Result<(), Status> {
        to.put(item);
        Ok(())
    }
}

impl Decoder for Raw {
    type Item = Bytes;
    type Error = Status;

    fn decode(&mut self, from: &mut DecodeBuf<'_>) -> Result<Option<Bytes>, Status> {
        Ok(Some(from.copy_to_bytes(from.remaining())))
    }
}
