//! Files that exceed one message: received in pieces, named by their hash, kept in memory.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use sha2::{Digest, Sha256};
use tonic::Status;

use super::error::{self, Invalid};
use super::limits::{BLOB_IDLE, MAX_BLOB_BYTES, MAX_BLOBS_BYTES};
use super::proto::{UploadBlobRequest, UploadBlobResponse};
use super::reason::Reason;
use crate::robot::counted;

/// All blobs of a server.
#[derive(Debug, Default)]
pub(super) struct Blobs(Mutex<HashMap<String, Blob>>);

#[derive(Debug)]
struct Blob {
    total: usize,
    used: Instant,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// What has come so far.
    Coming(Vec<u8>),
    /// All of it, with the right hash.
    Complete(Arc<Vec<u8>>),
}

impl Blob {
    fn len(&self) -> usize {
        match &self.content {
            Content::Coming(bytes) => bytes.len(),
            Content::Complete(bytes) => bytes.len(),
        }
    }
}

impl Blobs {
    fn lock(&self) -> MutexGuard<'_, HashMap<String, Blob>> {
        let mut blobs = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        blobs.retain(|_, blob| blob.used.elapsed() < BLOB_IDLE);
        blobs
    }

    /// A complete blob.
    pub(super) fn get(&self, id: &str, field: &str) -> Result<Arc<Vec<u8>>, Status> {
        if let Some(blob) = self.lock().get_mut(id)
            && let Content::Complete(bytes) = &blob.content
        {
            blob.used = Instant::now();
            return Ok(bytes.clone());
        }
        let why = format!("no complete blob {id}; upload it with UploadBlob, or again if it was idle for ten minutes");
        Err(error::not_found(Reason::BlobNotFound, id, field, why))
    }

    /// Keeps a file of the server's own for download; returns its name.
    pub(super) fn keep(&self, bytes: Vec<u8>) -> Result<String, Status> {
        let id = hash(&bytes);
        let mut blobs = self.lock();
        check_room(&blobs, bytes.len())?;
        let blob = Blob { total: bytes.len(), used: Instant::now(), content: Content::Complete(Arc::new(bytes)) };
        blobs.insert(id.clone(), blob);
        Ok(id)
    }

    /// Adds a piece.
    pub(super) fn add(&self, request: &UploadBlobRequest) -> Result<UploadBlobResponse, Status> {
        let UploadBlobRequest { blob_id, total_bytes, offset, data } = request;
        let is_hash = blob_id.len() == 64 && blob_id.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f'));
        if !is_hash {
            let why = "is no SHA-256; give the 64 lowercase hexadecimal digits of the hash of the whole content";
            return Err(Invalid::new("blob_id", why).into());
        }
        let total = usize::try_from(*total_bytes).unwrap_or(usize::MAX);
        if total == 0 {
            return Err(Invalid::new("total_bytes", "is 0; a blob has at least one byte").into());
        }
        error::at_most("total_bytes", total, ("max_blob_bytes", MAX_BLOB_BYTES))?;
        let mut blobs = self.lock();
        if !blobs.contains_key(blob_id) {
            check_room(&blobs, total)?;
        }
        let blob = blobs.entry(blob_id.clone()).or_insert_with(|| Blob {
            total,
            used: Instant::now(),
            content: Content::Coming(Vec::new()),
        });
        blob.used = Instant::now();
        if blob.total != total {
            let why = format!("is {total}, and {} in an earlier piece; send the same in all", blob.total);
            return Err(Invalid::new("total_bytes", why).into());
        }
        let received = blob.len();
        let Content::Coming(bytes) = &mut blob.content else {
            return Ok(UploadBlobResponse { received_bytes: total as u64, complete: true });
        };
        let from = usize::try_from(*offset).unwrap_or(usize::MAX);
        let end = from.saturating_add(data.len());
        if from > received || end > total {
            let bytes = counted(data.len(), "byte", "bytes");
            let why = format!("is {from} with {bytes}, and {received} of {total} are there; go on from there");
            return Err(Invalid::new("offset", why).into());
        }
        if end > received {
            bytes.extend_from_slice(&data[received - from..]);
        }
        if bytes.len() < total {
            return Ok(UploadBlobResponse { received_bytes: bytes.len() as u64, complete: false });
        }
        let bytes = std::mem::take(bytes);
        if hash(&bytes) != *blob_id {
            blobs.remove(blob_id);
            return Err(Invalid::new("blob_id", "is not the hash of the bytes that came; upload them again").into());
        }
        blob.content = Content::Complete(Arc::new(bytes));
        Ok(UploadBlobResponse { received_bytes: total as u64, complete: true })
    }
}

/// Space is taken for the whole of a blob when it begins.
fn check_room(blobs: &HashMap<String, Blob>, bytes: usize) -> Result<(), Status> {
    let taken: usize = blobs.values().map(|blob| blob.total).sum();
    error::at_most("total_bytes", taken.saturating_add(bytes), ("max_blobs_bytes", MAX_BLOBS_BYTES))
}

fn hash(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(id: &str, total: usize, offset: usize, data: &[u8]) -> UploadBlobRequest {
        let data = data.to_vec().into();
        UploadBlobRequest { blob_id: id.into(), total_bytes: total as u64, offset: offset as u64, data }
    }

    #[test]
    fn pieces_come_in_order_and_may_be_repeated() {
        let (blobs, content) = (Blobs::default(), b"a body of bytes".to_vec());
        let id = hash(&content);
        let add = |offset: usize, to: usize| blobs.add(&piece(&id, content.len(), offset, &content[offset..to]));
        assert_eq!(add(0, 4).expect("added").received_bytes, 4);
        assert_eq!(add(2, 7).expect("overlaps").received_bytes, 7);
        assert!(add(9, 12).is_err(), "a hole");
        assert!(blobs.get(&id, "blob_id").is_err(), "not complete");
        assert!(add(7, content.len()).expect("added").complete);
        assert_eq!(*blobs.get(&id, "blob_id").expect("complete"), content);
        assert!(add(0, 4).expect("again").complete);
    }

    #[test]
    fn what_is_not_what_it_says_is_forgotten() {
        let blobs = Blobs::default();
        let id = hash(b"right");
        assert!(blobs.add(&piece(&id, 5, 0, b"wrong")).is_err());
        assert!(blobs.add(&piece(&id, 5, 0, b"right")).expect("again").complete);
        for bad in [piece("xyz", 5, 0, b"right"), piece(&hash(b"y"), 0, 0, b""), piece(&hash(b"z"), 2, 0, b"long")] {
            assert!(blobs.add(&bad).is_err());
        }
        let too_long = blobs.add(&piece(&hash(b"w"), MAX_BLOB_BYTES + 1, 0, b"w")).expect_err("too long");
        assert_eq!(too_long.code(), tonic::Code::ResourceExhausted);
    }
}
