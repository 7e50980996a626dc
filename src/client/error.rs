//! Why a call has no answer.

use tonic::{Code, Status};
use tonic_types::StatusExt;

use crate::service::error::Invalid;

/// Why a call has no answer.
#[derive(Debug, thiserror::Error)]
pub enum ClientError {
    /// The address of the server cannot be read.
    #[error("{url} is no address of a server: {why}; write --server like http://127.0.0.1:50051")]
    Url {
        /// As given.
        url: String,
        /// The reason.
        why: String,
    },
    /// Certificates that cannot be used.
    #[error("the certificates for the connection cannot be used: {0}")]
    Certificates(String),
    /// What came cannot be written.
    #[error("cannot write what the server sent: {0}")]
    Write(std::io::Error),
    /// A token that is none.
    #[error("the token holds characters that no token has; give it as `sublevel token` printed it")]
    Token,
    /// Nobody answers there.
    #[error("cannot reach a server at {url}: {why}; start one with `sublevel serve` or name another with --server")]
    Unreachable {
        /// As given.
        url: String,
        /// The reason.
        why: String,
    },
    /// The server is connected and says nothing.
    #[error("the server at {url} did not answer in time; see whether it is a sublevel server and try again")]
    Silent {
        /// As given.
        url: String,
    },
    /// The server refused.
    #[error("the server refused: {} ({:?})", .0.message(), .0.code())]
    Refused(Box<Status>),
    /// The server answered something else.
    #[error("the server answered what this program does not understand: {0}; are the versions the same?")]
    Unexpected(&'static str),
    /// A field of the answer that is none of what it can be.
    #[error("the server answered what this program does not understand: {field} {why}; are the versions the same?")]
    Unreadable {
        /// Path in the answer, such as `verdicts[3]`.
        field: String,
        /// What it is.
        why: String,
    },
}

impl From<Invalid> for ClientError {
    /// What the reader of a message refuses. What it advises after a semicolon is for the sender.
    fn from(Invalid { field, why }: Invalid) -> Self {
        Self::unreadable(field, why.split("; ").next().unwrap_or_default())
    }
}

impl ClientError {
    /// A field of an answer that cannot be read.
    pub(super) fn unreadable(field: impl Into<String>, why: impl Into<String>) -> Self {
        Self::Unreadable { field: field.into(), why: why.into() }
    }

    pub(super) fn of(url: &str, status: Status) -> Self {
        match status.code() {
            // What tonic makes of its own timeout; the server cancels nothing.
            Code::Cancelled => Self::Silent { url: url.into() },
            _ => Self::Refused(Box::new(status)),
        }
    }

    /// Number of the gRPC status, if the server sent one.
    pub fn code(&self) -> Option<Code> {
        match self {
            Self::Refused(status) => Some(status.code()),
            _ => None,
        }
    }

    /// Reason for programs, such as `INVALID_FIELD`.
    pub fn reason(&self) -> Option<String> {
        match self {
            Self::Refused(status) => status.get_error_details().error_info().map(|info| info.reason.clone()),
            _ => None,
        }
    }

    /// Path of the field that is to blame: of the request that was refused, or of the answer that
    /// cannot be read.
    pub fn field(&self) -> Option<String> {
        match self {
            Self::Unreadable { field, .. } => Some(field.clone()),
            Self::Refused(status) => {
                let details = status.get_error_details();
                let violation = details.bad_request().and_then(|bad| bad.field_violations.first());
                violation.map(|violation| violation.field.clone())
            }
            _ => None,
        }
    }
}

/// tonic's own message is "transport error"; the reason is at the bottom.
pub(super) fn root_cause(error: &dyn std::error::Error) -> String {
    let mut cause = error;
    while let Some(deeper) = cause.source() {
        cause = deeper;
    }
    cause.to_string()
}
