//! Poses at a high rate.

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;

use super::connection::Client;
use super::error::ClientError;
use crate::measure::Pose;
use crate::service::packed::{POSE_NUMBERS, Packed};
use crate::service::proto::{StreamPosesRequest, StreamPosesResponse};

/// A stream of poses of some objects of a scene.
#[derive(Debug)]
pub struct PoseStream {
    messages: mpsc::Sender<StreamPosesRequest>,
    replies: Streaming<StreamPosesResponse>,
    url: String,
    sequence: u64,
}

/// What the server says of streamed poses.
#[derive(Clone, Debug)]
pub struct StreamedPoses {
    /// Revision at which all messages up to `sequence` are part of the scene.
    pub revision: u64,
    /// The latest message this is about.
    pub sequence: u64,
    /// Messages that were applied together.
    pub messages: u32,
    /// Poses that were overtaken by later ones.
    pub merged: u32,
    /// Why a message was refused.
    pub refused: Option<String>,
}

impl Client {
    /// Begins to stream poses of these objects.
    ///
    /// # Errors
    /// When the server does not answer.
    pub async fn stream_poses<'a>(
        &self,
        scene: &str,
        objects: impl IntoIterator<Item = &'a str>,
    ) -> Result<PoseStream, ClientError> {
        let (messages, receiver) = mpsc::channel(16);
        let names = objects.into_iter().map(Into::into).collect();
        // Which scene and objects are meant; poses follow.
        let first = StreamPosesRequest { scene: scene.into(), names, ..StreamPosesRequest::default() };
        messages.send(first).await.map_err(|_| ClientError::Silent { url: self.url().into() })?;
        let replies = self.scenes().stream_poses(ReceiverStream::new(receiver)).await.map_err(self.refused())?;
        Ok(PoseStream { messages, replies: replies.into_inner(), url: self.url().into(), sequence: 0 })
    }
}

impl PoseStream {
    /// Sends the poses of all objects, in their order; returns the number of the message. Waits
    /// while the server is far behind.
    ///
    /// # Errors
    /// When the server has ended the stream.
    pub async fn send(&mut self, poses: &[Pose]) -> Result<u64, ClientError> {
        let mut packed = Packed::with_capacity(8 * POSE_NUMBERS * poses.len());
        poses.iter().for_each(|pose| packed.pose(pose));
        self.sequence += 1;
        let sequence = self.sequence;
        let message = StreamPosesRequest { poses: packed.into_bytes(), sequence, ..StreamPosesRequest::default() };
        let ended = |_| ClientError::Silent { url: self.url.clone() };
        self.messages.send(message).await.map_err(ended)?;
        Ok(sequence)
    }

    /// Waits for what the server says next; none when it has ended the stream.
    ///
    /// # Errors
    /// When the stream broke.
    pub async fn next(&mut self) -> Result<Option<StreamedPoses>, ClientError> {
        let reply = self.replies.message().await.map_err(|status| ClientError::of(&self.url, status))?;
        Ok(reply.map(|reply| StreamedPoses {
            revision: reply.revision,
            sequence: reply.sequence,
            messages: reply.message_count,
            merged: reply.merged_count,
            refused: reply.error.map(|error| error.message),
        }))
    }
}
