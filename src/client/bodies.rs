//! Bodies and blobs.

use super::connection::{Client, Connection};
use super::error::ClientError;
use crate::body::BodyId;
use crate::scene::Geometry;
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto::blob_service_client::BlobServiceClient;
use crate::service::proto::body_service_client::BodyServiceClient;
use crate::service::proto::create_body_request::Source;
use crate::service::proto::get_body_response::Content;
use crate::service::proto::{
    self, BodyKind, BodySummary, CreateBodyRequest, DeleteBodyRequest, DownloadBlobRequest, GetBodyRequest,
    UploadBlobRequest,
};
use nalgebra::Vector3;
use sha2::{Digest, Sha256};

/// Bytes of a piece of a blob.
const PIECE: usize = 1 << 20;

/// What does not fit in one message with what is around it.
const LARGE: usize = MAX_MESSAGE_BYTES - 4096;

/// Where a body is from.
#[derive(Clone, Debug)]
pub enum BodySource {
    /// A file of any kind, JSON.
    File(String),
    /// A ball, m.
    Ball {
        /// Its radius, m.
        radius: f64,
    },
    /// A box about the origin, m.
    Box {
        /// Half the lengths of its edges, m.
        half_extents: Vector3<f64>,
    },
    /// A cylinder about z, m.
    Cylinder {
        /// Its radius, m.
        radius: f64,
        /// Half its height, m.
        half_height: f64,
    },
    /// A capsule about z, m.
    Capsule {
        /// Its radius, m.
        radius: f64,
        /// Half the length of its segment, m.
        half_height: f64,
    },
    /// A half-space `{x : normal·x <= offset}`.
    HalfSpace {
        /// Unit normal.
        normal: Vector3<f64>,
        /// Offset, m.
        offset: f64,
    },
}

/// A body that a server has.
#[derive(Clone, Debug)]
pub struct StoredBody {
    /// Its id.
    pub id: BodyId,
    /// Its name.
    pub name: String,
    /// What it is: `body`, `compound`, `ladder`, `sos-body`, `capsule` or `half-space`.
    pub kind: &'static str,
    /// Highest degree of its polynomials.
    pub degree: u32,
    /// Volume, m³, where it is known.
    pub volume_m3: Option<f64>,
    /// Whether the call made it; false when the server had it before.
    pub created: bool,
}

impl Client {
    fn bodies(&self) -> BodyServiceClient<Connection> {
        BodyServiceClient::new(self.channel()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    fn blobs(&self) -> BlobServiceClient<Connection> {
        BlobServiceClient::new(self.channel()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// Stores a body. Storing it twice is no error.
    ///
    /// # Errors
    /// When the server refuses it or does not answer.
    pub async fn create_body(&self, name: &str, source: BodySource) -> Result<StoredBody, ClientError> {
        let vector = |v: Vector3<f64>| Some(proto::Vector3 { x: v.x, y: v.y, z: v.z });
        let source = match source {
            BodySource::File(text) if text.len() > LARGE => Source::BlobId(self.upload(text.as_bytes()).await?),
            BodySource::File(text) => Source::File(text.into_bytes().into()),
            BodySource::Ball { radius } => Source::Ball(proto::BallSize { radius_m: radius }),
            BodySource::Box { half_extents } => Source::Box(proto::BoxSize { half_extents_m: vector(half_extents) }),
            BodySource::Cylinder { radius, half_height } => {
                Source::Cylinder(proto::CylinderSize { radius_m: radius, half_height_m: half_height })
            }
            BodySource::Capsule { radius, half_height } => {
                Source::Capsule(proto::CapsuleSize { radius_m: radius, half_height_m: half_height })
            }
            BodySource::HalfSpace { normal, offset } => {
                Source::HalfSpace(proto::HalfSpaceSize { normal: vector(normal), offset_m: offset })
            }
        };
        let request = CreateBodyRequest { name: name.into(), source: Some(source) };
        let response = self.bodies().create_body(request).await.map_err(self.refused())?.into_inner();
        let summary = response.body.ok_or(ClientError::Unexpected("no body"))?;
        stored(summary, response.created)
    }

    /// Stores the body of a file.
    ///
    /// # Errors
    /// As [`Client::create_body`].
    pub async fn create_from_file(&self, text: String) -> Result<StoredBody, ClientError> {
        self.create_body("", BodySource::File(text)).await
    }

    /// Stores an exact ball about the origin of its frame, radius in metres.
    ///
    /// # Errors
    /// As [`Client::create_body`].
    pub async fn create_ball(&self, name: &str, radius: f64) -> Result<BodyId, ClientError> {
        Ok(self.create_body(name, BodySource::Ball { radius }).await?.id)
    }

    /// Stores an exact box about the origin of its frame, half the edges in metres.
    ///
    /// # Errors
    /// As [`Client::create_body`].
    pub async fn create_box(&self, name: &str, half_extents: Vector3<f64>) -> Result<BodyId, ClientError> {
        Ok(self.create_body(name, BodySource::Box { half_extents }).await?.id)
    }

    /// Fetches a body and proves it again.
    ///
    /// # Errors
    /// When the server does not have it, or sends what cannot be proven.
    pub async fn body(&self, id: &BodyId) -> Result<Geometry, ClientError> {
        let response = self.bodies().get_body(GetBodyRequest { id: id.to_string() }).await;
        let file = match response.map_err(self.refused())?.into_inner().content {
            Some(Content::File(file)) => file.to_vec(),
            Some(Content::BlobId(id)) => self.download(&id).await?,
            None => return Err(ClientError::Unexpected("a body without a file")),
        };
        let text = String::from_utf8(file).map_err(|_| ClientError::Unexpected("a file that is no text"))?;
        Geometry::from_json(&text).map_err(|_| ClientError::Unexpected("a body that cannot be proven"))
    }

    /// Removes a body.
    ///
    /// # Errors
    /// When the server does not have it, or something uses it.
    pub async fn delete_body(&self, id: &BodyId) -> Result<(), ClientError> {
        let request = DeleteBodyRequest { id: id.to_string() };
        self.bodies().delete_body(request).await.map_err(self.refused())?;
        Ok(())
    }

    /// Sends a file in pieces; returns the name of the blob.
    ///
    /// # Errors
    /// When the server refuses a piece.
    pub async fn upload(&self, file: &[u8]) -> Result<String, ClientError> {
        let blob_id: String = Sha256::digest(file).iter().map(|byte| format!("{byte:02x}")).collect();
        let (mut client, total_bytes) = (self.blobs(), file.len() as u64);
        for (index, piece) in file.chunks(PIECE).enumerate() {
            let offset = (index * PIECE) as u64;
            let data = piece.to_vec().into();
            let request = UploadBlobRequest { blob_id: blob_id.clone(), total_bytes, offset, data };
            client.upload_blob(request).await.map_err(self.refused())?;
        }
        Ok(blob_id)
    }

    /// Fetches a blob in pieces.
    ///
    /// # Errors
    /// When the server does not have it.
    pub async fn download(&self, blob_id: &str) -> Result<Vec<u8>, ClientError> {
        let (mut client, mut file) = (self.blobs(), Vec::new());
        loop {
            let request = DownloadBlobRequest { blob_id: blob_id.into(), offset: file.len() as u64, max_bytes: None };
            let piece = client.download_blob(request).await.map_err(self.refused())?.into_inner();
            file.extend_from_slice(&piece.data);
            if file.len() as u64 >= piece.total_bytes || piece.data.is_empty() {
                return Ok(file);
            }
        }
    }
}

fn stored(summary: BodySummary, created: bool) -> Result<StoredBody, ClientError> {
    let kind = match summary.kind() {
        BodyKind::Compound => "compound",
        BodyKind::Ladder => "ladder",
        BodyKind::SosBody => "sos-body",
        BodyKind::Capsule => "capsule",
        BodyKind::HalfSpace => "half-space",
        BodyKind::Body | BodyKind::Unspecified => "body",
    };
    let id = summary.id.parse().map_err(|_| ClientError::Unexpected("an id that is none"))?;
    let BodySummary { name, degree, volume_m3, .. } = summary;
    Ok(StoredBody { id, name, kind, degree, volume_m3, created })
}
