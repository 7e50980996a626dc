//! BlobService.

use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::limits::MAX_MESSAGE_BYTES;
use super::proto::blob_service_server::BlobService;
use super::proto::{DownloadBlobRequest, DownloadBlobResponse, UploadBlobRequest, UploadBlobResponse};

#[derive(Debug)]
pub(super) struct BlobCalls(pub(super) AppState);

#[tonic::async_trait]
impl BlobService for BlobCalls {
    async fn upload_blob(&self, request: Request<UploadBlobRequest>) -> Result<Response<UploadBlobResponse>, Status> {
        let (app, request) = (self.0.clone(), request.into_inner());
        // The hash of a hundred megabytes takes a while.
        let response = self.0.work(move || app.blobs().add(&request)).await??;
        Ok(Response::new(response))
    }

    async fn download_blob(
        &self,
        request: Request<DownloadBlobRequest>,
    ) -> Result<Response<DownloadBlobResponse>, Status> {
        let DownloadBlobRequest { blob_id, offset, max_bytes } = request.into_inner();
        let blob = self.0.blobs().get(&blob_id, "blob_id")?;
        let from = usize::try_from(offset).unwrap_or(usize::MAX).min(blob.len());
        let most = max_bytes.map_or(usize::MAX, |most| usize::try_from(most).unwrap_or(usize::MAX));
        let to = from.saturating_add(most.min(MAX_MESSAGE_BYTES - 1024)).min(blob.len());
        let data = blob[from..to].to_vec().into();
        Ok(Response::new(DownloadBlobResponse { data, total_bytes: blob.len() as u64 }))
    }
}
