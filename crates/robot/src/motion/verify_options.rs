//! What a check of a certificate is given.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use sublevel_core::body::Shape;

use super::certificate_error::CertificateError;

/// Bodies and compounds by their ids.
pub type KnownBodies<'a> = dyn Fn(&str) -> Option<Arc<Shape>> + 'a;

/// How certificates are checked.
#[derive(Clone, Copy, Default)]
pub struct VerifyOptions<'a> {
    /// Bodies by their ids that are proven already; those with the same numbers are not proven
    /// again.
    pub known: Option<&'a KnownBodies<'a>>,
    /// Ends the check when it is set.
    pub stop: Option<&'a AtomicBool>,
}

impl fmt::Debug for VerifyOptions<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("VerifyOptions").field("known", &self.known.is_some()).field("stop", &self.stop).finish()
    }
}

impl VerifyOptions<'_> {
    pub(crate) fn check_time(&self) -> Result<(), CertificateError> {
        let is_over = self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed));
        if is_over { Err(CertificateError::Stopped) } else { Ok(()) }
    }
}
