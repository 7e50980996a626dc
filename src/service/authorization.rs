//! Who may call what: a token in the metadata of a call, `authorization: Bearer TOKEN`, has a role,
//! and each call needs one.

use std::sync::Arc;

use tokio::sync::watch;
use tonic::Status;
use tonic::body::Body;
use tonic::codegen::http;

use super::tokens::Tokens;
use super::{calls, error};

/// Calls that need no token: probes.
const OPEN: &str = "/grpc.health.v1.Health/";

/// Lets calls pass that show a token with the role they need; all, where there are no tokens.
#[derive(Clone, Debug)]
pub(super) struct Authorization(pub(super) Option<watch::Receiver<Arc<Tokens>>>);

impl Authorization {
    /// Who makes a call.
    ///
    /// # Errors
    /// UNAUTHENTICATED or PERMISSION_DENIED.
    pub(super) fn check(&self, request: &http::Request<Body>) -> Result<Admission, Status> {
        let path = request.uri().path();
        let Some(tokens) = self.0.as_ref().filter(|_| !path.starts_with(OPEN)) else { return Ok(Admission(None)) };
        let shown = request.headers().get(http::header::AUTHORIZATION);
        let name = permitted(&tokens.borrow(), shown, path)?;
        let (tokens, shown, path) = (tokens.clone(), shown.cloned(), path.to_owned());
        Ok(Admission(Some(Shown { name, tokens, shown, path })))
    }
}

/// Name of the token that a call shows.
fn permitted(tokens: &Tokens, shown: Option<&http::HeaderValue>, path: &str) -> Result<String, Status> {
    let shown = shown.map(http::HeaderValue::as_bytes);
    let (name, role) = shown
        .and_then(|shown| shown.strip_prefix(b"Bearer ").or_else(|| shown.strip_prefix(b"bearer ")))
        .and_then(|token| tokens.find(token))
        .ok_or_else(|| error::unauthenticated(shown.is_some()))?;
    let needed = calls::needed(path);
    if role < needed { Err(error::permission_denied(path, name, needed)) } else { Ok(name.to_owned()) }
}

/// A call that may go on, as long as its token stays.
#[derive(Clone, Debug)]
pub(super) struct Admission(Option<Shown>);

#[derive(Clone, Debug)]
struct Shown {
    name: String,
    tokens: watch::Receiver<Arc<Tokens>>,
    shown: Option<http::HeaderValue>,
    path: String,
}

impl Admission {
    /// Name of the token; none where none is needed.
    pub(super) fn client(&self) -> Option<&str> {
        self.0.as_ref().map(|shown| shown.name.as_str())
    }

    /// Waits until the token is not good for the call any more, and says why; for ever where none
    /// is needed.
    pub(super) async fn revoked(self) -> Status {
        let Some(Shown { mut tokens, shown, path, .. }) = self.0 else { return std::future::pending().await };
        loop {
            if let Err(status) = permitted(&tokens.borrow_and_update(), shown.as_ref(), &path) {
                return status;
            }
            // Ends with the server only.
            if tokens.changed().await.is_err() {
                return std::future::pending().await;
            }
        }
    }
}
