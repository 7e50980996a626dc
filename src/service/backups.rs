//! Backup: the catalogue as one file, in pieces.

use std::io::Read;
use std::time::Duration;

use sha2::{Digest, Sha256};
use tokio::sync::{mpsc, watch};
use tonic::Status;

use super::app_state::{AppState, stopped};
use super::proto::BackupResponse;
use super::reason::Reason;
use super::{error, tokens};
use crate::store::BACKUP_PREFIX;

/// Bytes of a piece.
const PIECE_BYTES: usize = 1 << 20;

/// Longest time that a client takes for a piece.
const PIECE_PATIENCE: Duration = Duration::from_secs(30);

/// Sends a copy of the catalogue, whose hash ends it; one at a time.
pub(super) async fn run(app: AppState, pieces: mpsc::Sender<Result<BackupResponse, Status>>) {
    let (sender, of, stopping) = (pieces.clone(), app.clone(), app.stopping());
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
                    return send(&sender, last, &stopping);
                }
                hash.update(&data);
                total_bytes += data.len() as u64;
                let piece = BackupResponse { data: data.into(), ..BackupResponse::default() };
                send(&sender, piece, &stopping)?;
                if sender.is_closed() {
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

/// Waits for the client to take the pieces before, as long as it is not too slow for the next
/// backup and the server does not stop.
fn send(
    pieces: &mpsc::Sender<Result<BackupResponse, Status>>,
    piece: BackupResponse,
    stopping: &watch::Receiver<bool>,
) -> Result<(), Status> {
    let mut stopping = stopping.clone();
    let sending = async {
        tokio::select! {
            // The client is gone if it cannot be sent.
            sent = tokio::time::timeout(PIECE_PATIENCE, pieces.send(Ok(piece))) => match sent {
                Ok(_) => Ok(()),
                Err(_) => Err(error::not_read(PIECE_PATIENCE)),
            },
            () = stopped(&mut stopping) => Err(error::unavailable(Reason::Stopping, "the server is stopping; ask again")),
        }
    };
    tokio::runtime::Handle::current().block_on(sending)
}
