//! Backup: the catalogue as one file, in pieces.

use std::io::Read;

use sha2::{Digest, Sha256};
use tokio::sync::mpsc;
use tonic::Status;

use super::app_state::AppState;
use super::proto::BackupResponse;
use super::{error, tokens};
use crate::store::BACKUP_PREFIX;

/// Bytes of a piece.
const PIECE_BYTES: usize = 1 << 20;

/// Sends a copy of the catalogue, whose hash ends it; one at a time.
pub(super) async fn run(app: AppState, pieces: mpsc::Sender<Result<BackupResponse, Status>>) {
    let (sender, of) = (pieces.clone(), app.clone());
    let made = async {
        let catalogue = app.catalogue().await?;
        let work = move || -> Result<(), Status> {
            // The client is gone since it waited for its turn.
            if sender.is_closed() {
                return Ok(());
            }
            let failed = |error: &dyn std::fmt::Display| error::internal(error);
            let folder = tempfile::Builder::new()
                .prefix(BACKUP_PREFIX)
                .tempdir_in(catalogue.dir())
                .map_err(|error| failed(&error))?;
            let path = folder.path().join("backup.redb");
            catalogue.backup(&path).map_err(|error| error::catalogue(&error.into(), "backup"))?;
            let mut file = std::fs::File::open(&path).map_err(|error| failed(&error))?;
            let (mut hash, mut total_bytes) = (Sha256::new(), 0);
            loop {
                let mut data = Vec::with_capacity(PIECE_BYTES);
                file.by_ref().take(PIECE_BYTES as u64).read_to_end(&mut data).map_err(|error| failed(&error))?;
                if data.is_empty() {
                    let sha256 = tokens::hex(&hash.finalize().into());
                    let last = BackupResponse { data: Vec::new().into(), total_bytes, sha256 };
                    // The client is gone.
                    let _ = sender.blocking_send(Ok(last));
                    return Ok(());
                }
                hash.update(&data);
                total_bytes += data.len() as u64;
                let piece = BackupResponse { data: data.into(), ..BackupResponse::default() };
                if sender.blocking_send(Ok(piece)).is_err() {
                    return Ok(());
                }
            }
        };
        of.back_up(work).await?
    };
    if let Err(status) = made.await {
        let _ = pieces.send(Err(status)).await;
    }
}
