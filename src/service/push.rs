//! The client side of `sublevel push`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status};

use crate::body::Shape;

use super::limits::MAX_MESSAGE_BYTES;
use super::proto::body_service_client::BodyServiceClient;
use super::proto::{BodySummary, CreateBodyRequest};

/// Largest body file: a message less what `CreateBodyRequest` puts around it.
const MAX_BODY_BYTES: u64 = MAX_MESSAGE_BYTES as u64 - 16;

/// How long the server may take to answer for one file; proving takes seconds at worst, but others
/// may be before it.
const PATIENCE: Duration = Duration::from_secs(60);

/// A body file that is stored in the server.
#[derive(Debug, Clone)]
pub struct Pushed {
    /// The file.
    pub file: PathBuf,
    /// The body as the server has it.
    pub body: BodySummary,
    /// False when the server had it before.
    pub created: bool,
}

/// Why a body file is not stored.
#[derive(Debug, thiserror::Error)]
pub enum PushError {
    /// The address of the server cannot be read.
    #[error("--server {url} is no address of a server: {why}; write it like http://127.0.0.1:50051")]
    Url {
        /// As given.
        url: String,
        /// The reason.
        why: String,
    },
    /// Nobody answers there.
    #[error("cannot reach a server at {url}: {why}; start one with `sublevel serve` or name another with --server")]
    Unreachable {
        /// As given.
        url: String,
        /// The reason.
        why: String,
    },
    /// The file cannot be read.
    #[error("cannot read {}: {source}; check the path and its permissions", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is no valid body file.
    #[error("{} cannot be stored: {why}", .file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The reason, with its remedy.
        why: String,
    },
    /// The file holds a compound.
    #[error(
        "{} holds a compound, and servers store single bodies only; fit the object without --parts",
        .file.display()
    )]
    Compound {
        /// The file.
        file: PathBuf,
    },
    /// The file does not fit into a message.
    #[error(
        "{} has {bytes} bytes, and a server takes at most {MAX_BODY_BYTES}; fit the body at a lower degree",
        .file.display()
    )]
    Large {
        /// The file.
        file: PathBuf,
        /// Its length.
        bytes: u64,
    },
    /// The server is connected and says nothing.
    #[error(
        "the server at {url} did not answer for {} within {} s; see whether it is a sublevel server and try again",
        .file.display(),
        .patience.as_secs()
    )]
    Silent {
        /// As given.
        url: String,
        /// The file.
        file: PathBuf,
        /// How long it had.
        patience: Duration,
    },
    /// The server refused.
    #[error("the server did not store {}: {} ({:?})", .file.display(), .status.message(), .status.code())]
    Refused {
        /// The file.
        file: PathBuf,
        /// Its answer.
        status: Box<Status>,
    },
}

/// Stores body files in a running server. All files are checked before the first is sent; storing a
/// file twice is no error.
///
/// # Errors
/// The first file that cannot be stored; those before it are.
pub async fn push(url: &str, files: &[PathBuf]) -> Result<Vec<Pushed>, PushError> {
    push_within(PATIENCE, url, files).await
}

async fn push_within(patience: Duration, url: &str, files: &[PathBuf]) -> Result<Vec<Pushed>, PushError> {
    let mut contents = Vec::with_capacity(files.len());
    for file in files {
        contents.push((file, read(file)?));
    }
    let mut client = BodyServiceClient::new(connect(url, patience).await?)
        .max_decoding_message_size(MAX_MESSAGE_BYTES)
        .max_encoding_message_size(MAX_MESSAGE_BYTES);
    let mut pushed = Vec::with_capacity(files.len());
    for (file, text) in contents {
        let request = CreateBodyRequest { body_file_json: text.into_bytes().into() };
        let refused = |status: Status| match status.code() {
            // What tonic makes of its own timeout; the server cancels nothing.
            Code::Cancelled => PushError::Silent { url: url.into(), file: file.clone(), patience },
            _ => PushError::Refused { file: file.clone(), status: Box::new(status) },
        };
        let response = client.create_body(request).await.map_err(refused)?.into_inner();
        let body = response.body.ok_or_else(|| {
            refused(Status::new(
                Code::Internal,
                "it answered without saying what it stored; are the versions the same?",
            ))
        })?;
        pushed.push(Pushed { file: file.clone(), body, created: response.created });
    }
    Ok(pushed)
}

fn read(file: &Path) -> Result<String, PushError> {
    let unreadable = |source| PushError::Read { file: file.into(), source };
    // Before it is read, since it may be anything.
    let bytes = std::fs::metadata(file).map_err(unreadable)?.len();
    if bytes > MAX_BODY_BYTES {
        return Err(PushError::Large { file: file.into(), bytes });
    }
    let text = std::fs::read_to_string(file).map_err(unreadable)?;
    match Shape::from_json(&text) {
        Ok(Shape::Body(_)) => Ok(text),
        Ok(Shape::Compound(_)) => Err(PushError::Compound { file: file.into() }),
        Err(error) => Err(PushError::File { file: file.into(), why: error.to_string() }),
    }
}

pub(super) async fn connect(url: &str, patience: Duration) -> Result<Channel, PushError> {
    let unusable = |why: String| PushError::Url { url: url.into(), why };
    let endpoint = Endpoint::from_shared(url.to_owned()).map_err(|error| unusable(error.to_string()))?;
    if endpoint.uri().scheme_str() != Some("http") {
        return Err(unusable("its scheme is not http (there is no TLS yet)".into()));
    }
    endpoint
        .connect_timeout(Duration::from_secs(5))
        .timeout(patience)
        .tcp_nodelay(true)
        .connect()
        .await
        .map_err(|error| PushError::Unreachable { url: url.into(), why: root_cause(&error) })
}

/// tonic's own message is "transport error"; the reason is at the bottom.
fn root_cause(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Body;

    #[tokio::test]
    async fn a_server_that_never_answers_is_given_up() {
        let dir = tempfile::tempdir().expect("a directory");
        let file = dir.path().join("ball.json");
        let ball = Body::ball("ball", nalgebra::Vector3::zeros(), 1.0).expect("a ball");
        std::fs::write(&file, ball.to_json()).expect("written");
        let mute = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
        let url = format!("http://{}", mute.local_addr().expect("an address"));
        let files = [file];
        let pushing = push_within(Duration::from_millis(300), &url, &files);
        let error = tokio::time::timeout(Duration::from_secs(20), pushing).await.expect("in time").expect_err("mute");
        assert!(matches!(error, PushError::Silent { .. }), "{error}");
    }
}
