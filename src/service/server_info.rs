//! ServerService.

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::backups;
use super::limits::{
    MAX_ANSWERS, MAX_BLOB_BYTES, MAX_BLOBS_BYTES, MAX_CERTIFICATES, MAX_MESSAGE_BYTES, MAX_MOTIONS, MAX_RAYS,
    MAX_STATE_POSES, MAX_STATES,
};
use super::proto::server_service_server::ServerService;
use super::proto::{BackupRequest, BackupResponse, GetServerInfoRequest, GetServerInfoResponse, Limits};
use super::wire::count;
use crate::scene::{MAX_NAME_BYTES, MAX_OBJECTS, MAX_PAIR_RULES, MAX_ROBOTS, MAX_RUNGS};
use crate::store::{FORK_IDLE, MAX_FORKS};

#[derive(Debug)]
pub(super) struct ServerInfo(pub(super) AppState);

#[tonic::async_trait]
impl ServerService for ServerInfo {
    async fn get_server_info(
        &self,
        _: Request<GetServerInfoRequest>,
    ) -> Result<Response<GetServerInfoResponse>, Status> {
        let features = if cfg!(feature = "fit") { vec!["fit".to_owned()] } else { Vec::new() };
        let simd_level = match crate::polynomial::widest() {
            "AVX-512" => "avx512",
            "AVX2" => "avx2",
            _ => "scalar",
        };
        let limits = Limits {
            max_message_bytes: MAX_MESSAGE_BYTES as u64,
            max_name_bytes: count(MAX_NAME_BYTES),
            max_objects: count(MAX_OBJECTS),
            max_pair_rules: count(MAX_PAIR_RULES),
            max_answers: count(MAX_ANSWERS),
            max_states: count(MAX_STATES),
            max_motions: count(MAX_MOTIONS),
            max_certificates: count(MAX_CERTIFICATES),
            max_state_poses: count(MAX_STATE_POSES),
            max_rays: count(MAX_RAYS),
            max_forks: count(MAX_FORKS),
            fork_idle_s: FORK_IDLE.as_secs_f64(),
            max_blob_bytes: MAX_BLOB_BYTES as u64,
            max_blobs_bytes: MAX_BLOBS_BYTES as u64,
            max_calls: count(self.0.limits().calls),
            call_limit_s: self.0.limits().call_s,
            max_rungs: count(MAX_RUNGS),
            max_robots: count(MAX_ROBOTS),
        };
        Ok(Response::new(GetServerInfoResponse {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            features,
            solver: "newton-active-set".to_owned(),
            simd_level: simd_level.to_owned(),
            solver_threads: count(self.0.crew().threads()),
            limits: Some(limits),
            ready: self.0.is_loaded(),
        }))
    }

    type BackupStream = ReceiverStream<Result<BackupResponse, Status>>;

    async fn backup(&self, _: Request<BackupRequest>) -> Result<Response<Self::BackupStream>, Status> {
        let (sender, stream) = mpsc::channel(1);
        tokio::spawn(backups::run(self.0.clone(), sender));
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}
