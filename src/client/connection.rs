//! A connection to a server.

use std::path::PathBuf;
use std::time::Duration;

use tonic::metadata::{Ascii, MetadataValue};
use tonic::service::Interceptor;
use tonic::service::interceptor::InterceptedService;
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use super::error::{ClientError, root_cause};
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto;
use crate::service::proto::server_service_client::ServerServiceClient;

/// How long the server may take to answer; proving takes seconds at worst, but others may be before
/// it.
const PATIENCE: Duration = Duration::from_secs(60);

/// What calls go through: the connection, and the token that each of them shows.
pub type Connection = InterceptedService<Channel, Credentials>;

/// A connection to a server. Clones share it.
#[derive(Clone, Debug)]
pub struct Client {
    channel: Connection,
    url: String,
}

/// How a client connects.
#[derive(Clone, Debug)]
pub struct ClientOptions {
    /// How long the server may take to answer.
    pub patience: Duration,
    /// What is shown to a server that asks for tokens.
    pub token: Option<String>,
    /// Roots of the server's certificate, PEM; none: those of the address must be known otherwise,
    /// and `https` needs them.
    pub ca: Option<PathBuf>,
    /// The client's own certificate and its key, PEM.
    pub identity: Option<[PathBuf; 2]>,
}

impl Default for ClientOptions {
    fn default() -> Self {
        Self { patience: PATIENCE, token: None, ca: None, identity: None }
    }
}

impl ClientOptions {
    /// The token of `SUBLEVEL_TOKEN`, the roots of `SUBLEVEL_CA`, and the client's certificate of
    /// `SUBLEVEL_CLIENT_CERTIFICATE` and `SUBLEVEL_CLIENT_KEY`, where they are set.
    pub fn from_environment() -> Self {
        let path = |name: &str| std::env::var_os(name).map(PathBuf::from);
        let identity = path("SUBLEVEL_CLIENT_CERTIFICATE").zip(path("SUBLEVEL_CLIENT_KEY"));
        Self {
            token: std::env::var("SUBLEVEL_TOKEN").ok(),
            ca: path("SUBLEVEL_CA"),
            identity: identity.map(|(certificate, key)| [certificate, key]),
            ..Self::default()
        }
    }
}

/// Shows a token with every call.
#[derive(Clone, Debug, Default)]
pub struct Credentials(Option<MetadataValue<Ascii>>);

impl Interceptor for Credentials {
    fn call(&mut self, mut request: tonic::Request<()>) -> Result<tonic::Request<()>, tonic::Status> {
        if let Some(token) = &self.0 {
            request.metadata_mut().insert("authorization", token.clone());
        }
        Ok(request)
    }
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
    /// Connects to a server, such as `http://127.0.0.1:50051`, without a token.
    ///
    /// # Errors
    /// An address that is none, or that nobody answers at.
    pub async fn connect(url: &str) -> Result<Self, ClientError> {
        Self::connect_with(url, &ClientOptions::default()).await
    }

    /// Connects to a server, with `https` encrypted.
    ///
    /// # Errors
    /// As [`Client::connect`]; certificates and tokens that cannot be used.
    pub async fn connect_with(url: &str, options: &ClientOptions) -> Result<Self, ClientError> {
        let credentials = match &options.token {
            None => Credentials::default(),
            Some(token) => {
                let shown = format!("Bearer {}", token.trim()).parse();
                Credentials(Some(shown.map_err(|_| ClientError::Token)?))
            }
        };
        let channel = endpoint(url, options)?
            .timeout(options.patience)
            .connect()
            .await
            .map_err(|error| ClientError::Unreachable { url: url.into(), why: root_cause(&error) })?;
        Ok(Self { channel: InterceptedService::new(channel, credentials), url: url.into() })
    }

    /// The address it is connected to.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// The connection, for calls that this client does not have.
    pub fn channel(&self) -> Connection {
        self.channel.clone()
    }

    /// Whether the server answers calls: not while it loads or stops.
    ///
    /// # Errors
    /// When the server does not answer.
    pub async fn health(&self) -> Result<bool, ClientError> {
        let request = HealthCheckRequest { service: String::new() };
        let response = HealthClient::new(self.channel()).check(request).await.map_err(self.refused())?;
        Ok(response.into_inner().status() == ServingStatus::Serving)
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

/// Where a server is, with certificates where its address begins with `https`.
///
/// # Errors
/// An address that is none, and certificates that cannot be used.
pub fn endpoint(url: &str, options: &ClientOptions) -> Result<Endpoint, ClientError> {
    let unusable = |why: String| ClientError::Url { url: url.into(), why };
    let mut endpoint = Endpoint::from_shared(url.to_owned()).map_err(|error| unusable(error.to_string()))?;
    match endpoint.uri().scheme_str() {
        Some("http") => {}
        Some("https") => {
            let tls = tls_config(options)?;
            endpoint = endpoint.tls_config(tls).map_err(|error| ClientError::Certificates(root_cause(&error)))?;
        }
        _ => return Err(unusable("its scheme is neither http nor https".into())),
    }
    Ok(endpoint
        .connect_timeout(Duration::from_secs(5))
        .tcp_nodelay(true)
        // An answer comes without waiting on the way.
        .initial_stream_window_size(MAX_MESSAGE_BYTES as u32)
        .initial_connection_window_size(2 * MAX_MESSAGE_BYTES as u32))
}

fn tls_config(options: &ClientOptions) -> Result<ClientTlsConfig, ClientError> {
    let read = |path: &PathBuf| {
        std::fs::read(path).map_err(|error| ClientError::Certificates(format!("{}: {error}", path.display())))
    };
    let mut tls = ClientTlsConfig::new();
    match &options.ca {
        Some(path) => tls = tls.ca_certificate(Certificate::from_pem(read(path)?)),
        None => {
            let why = "https needs the root of the server's certificate; name its PEM file in SUBLEVEL_CA";
            return Err(ClientError::Certificates(why.into()));
        }
    }
    if let Some([certificate, key]) = &options.identity {
        tls = tls.identity(Identity::from_pem(read(certificate)?, read(key)?));
    }
    Ok(tls)
}
