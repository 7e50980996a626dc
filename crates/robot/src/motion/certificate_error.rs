//! What may be wrong with a certificate.

/// Why a text is no certificate, or proves nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CertificateError {
    /// Not JSON of this format.
    #[error("this is no motion certificate: {0}")]
    Format(String),
    /// Something was changed.
    #[error("the digest does not fit: the certificate was changed or cut off")]
    Digest,
    /// A part that cannot be used.
    #[error("{part} is not usable: {reason}")]
    Part {
        /// Which part, as a path of fields.
        part: String,
        /// Why.
        reason: String,
    },
    /// A record that proves nothing.
    #[error("records[{record}] does not prove that its pair keeps apart: {lower_m} m is not above {threshold_m} m")]
    Record {
        /// Position of the record.
        record: usize,
        /// Lower bound of the signed distance that it proves, metres.
        lower_m: f64,
        /// What it had to exceed, metres.
        threshold_m: f64,
    },
    /// A pair that is not proven over all of the path.
    #[error("{a} and {b} are not proven to keep apart on all of segment {segment}")]
    Gap {
        /// One of the two.
        a: String,
        /// The other.
        b: String,
        /// Position of the segment of the path.
        segment: usize,
    },
    /// Another robot, scene or body than what it is compared with.
    #[error("the certificate is of another {0}")]
    Other(&'static str),
    /// The check was ended before it was complete.
    #[error("the check was ended before it was complete")]
    Stopped,
}
