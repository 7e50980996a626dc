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
    /// Name of the token that a call shows; none where it needs none.
    ///
    /// # Errors
    /// UNAUTHENTICATED or PERMISSION_DENIED.
    pub(super) fn check(&self, request: &http::Request<Body>) -> Result<Option<String>, Status> {
        let path = request.uri().path();
        let Some(tokens) = self.0.as_ref().filter(|_| !path.starts_with(OPEN)) else { return Ok(None) };
        let shown = request.headers().get(http::header::AUTHORIZATION).map(http::HeaderValue::as_bytes);
        let tokens = tokens.borrow();
        let (name, role) = shown
            .and_then(|shown| shown.strip_prefix(b"Bearer ").or_else(|| shown.strip_prefix(b"bearer ")))
            .and_then(|token| tokens.find(token))
            .ok_or_else(|| error::unauthenticated(shown.is_some()))?;
        let needed = calls::needed(path);
        if role < needed {
            return Err(error::permission_denied(path, name, needed));
        }
        Ok(Some(name.to_owned()))
    }
}
