//! A connection to a server.

use std::time::Duration;

use tonic::transport::{Channel, Endpoint};

use super::error::{ClientError, root_cause};
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto;
use crate::service::proto::server_service_client::ServerServiceClient;

/// How long the server may take to answer; proving takes seconds at worst, but others may be before
/// it.
const PATIENCE: Duration = Duration::from_secs(60);

/// A connection to a server. Clones share it.
#[derive(Clone, Debug)]
pub struct Client {
    channel: Channel,
    url: String,
}

/// What a server is, see `GetServerInfo`.
#[derive(Clone, Debug)]
pub struct ServerInfo {
    /// Its version.
    pub version: String,
    /// What was compiled in.
    pub features: Vec<String>,
    /// Instruction set of its queries.
    pub simd_level: String,
    /// Threads that answer questions.
    pub solver_threads: u32,
    /// Whether its catalogue is loaded.
    pub ready: bool,
    /// Longest message, bytes.
    pub max_message_bytes: u64,
}

impl Client {
    /// Connects to a server, such as `http://127.0.0.1:50051`.
    ///
    /// # Errors
    /// An address that is none, or that nobody answers at.
    pub async fn connect(url: &str) -> Result<Self, ClientError> {
        Self::connect_with_patience(url, PATIENCE).await
    }

    /// The same with another limit for the time of an answer.
    ///
    /// # Errors
    /// As [`Client::connect`].
    pub async fn connect_with_patience(url: &str, patience: Duration) -> Result<Self, ClientError> {
        let unusable = |why: String| ClientError::Url { url: url.into(), why };
        let endpoint = Endpoint::from_shared(url.to_owned()).map_err(|error| unusable(error.to_string()))?;
        if endpoint.uri().scheme_str() != Some("http") {
            return Err(unusable("its scheme is not http (there is no TLS yet)".into()));
        }
        let channel = endpoint
            .connect_timeout(Duration::from_secs(5))
            .timeout(patience)
            .tcp_nodelay(true)
            // An answer comes without waiting on the way.
            .initial_stream_window_size(MAX_MESSAGE_BYTES as u32)
            .initial_connection_window_size(2 * MAX_MESSAGE_BYTES as u32)
            .connect()
            .await
            .map_err(|error| ClientError::Unreachable { url: url.into(), why: root_cause(&error) })?;
        Ok(Self { channel, url: url.into() })
    }

    /// The address it is connected to.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// The connection, for calls that this client does not have.
    pub fn channel(&self) -> Channel {
        self.channel.clone()
    }

    /// What the server is.
    ///
    /// # Errors
    /// When the server does not answer.
    pub async fn server_info(&self) -> Result<ServerInfo, ClientError> {
        let mut client = ServerServiceClient::new(self.channel());
        let info = client.get_server_info(proto::GetServerInfoRequest {}).await.map_err(self.refused())?.into_inner();
        Ok(ServerInfo {
            version: info.version,
            features: info.features,
            simd_level: info.simd_level,
            solver_threads: info.solver_threads,
            ready: info.ready,
            max_message_bytes: info.limits.map(|limits| limits.max_message_bytes).unwrap_or_default(),
        })
    }

    pub(super) fn refused(&self) -> impl Fn(tonic::Status) -> ClientError + use<> {
        let url = self.url.clone();
        move |status| ClientError::of(&url, status)
    }
}
