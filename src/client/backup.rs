//! Backups.

use std::io::Write;

use sha2::{Digest, Sha256};

use super::connection::Client;
use super::error::ClientError;
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto::BackupRequest;
use crate::service::proto::server_service_client::ServerServiceClient;
use crate::service::tokens;

impl Client {
    /// Writes a copy of the server's catalogue, as it is now, and returns its size in bytes.
    ///
    /// # Errors
    /// When the server refuses or fails, when what came is not what was sent, or when it cannot be
    /// written.
    pub async fn backup(&self, to: &mut impl Write) -> Result<u64, ClientError> {
        let mut client = ServerServiceClient::new(self.channel()).max_decoding_message_size(MAX_MESSAGE_BYTES);
        let mut pieces = client.backup(BackupRequest {}).await.map_err(self.refused())?.into_inner();
        let (mut hash, mut bytes) = (Sha256::new(), 0);
        while let Some(piece) = pieces.message().await.map_err(self.refused())? {
            if !piece.sha256.is_empty() {
                let whole = piece.total_bytes == bytes && piece.sha256 == tokens::hex(&hash.finalize().into());
                return if whole { Ok(bytes) } else { Err(ClientError::Unexpected("a backup with another hash")) };
            }
            hash.update(&piece.data);
            bytes += piece.data.len() as u64;
            to.write_all(&piece.data).map_err(ClientError::Write)?;
        }
        Err(ClientError::Unexpected("a backup without an end"))
    }
}
