//! Certificates of the server, read again when their files change.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use tokio::sync::watch;
use tokio_rustls::rustls::crypto::ring;
use tokio_rustls::rustls::pki_types::pem::{self, PemObject};
use tokio_rustls::rustls::pki_types::{CertificateDer, CertificateRevocationListDer, PrivateKeyDer};
use tokio_rustls::rustls::server::WebPkiClientVerifier;
use tokio_rustls::rustls::{self, RootCertStore, ServerConfig};

use super::config::TlsConfig;
use super::watched_files::watched;

/// Why certificates cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file that cannot be read, or is no PEM.
    #[error("{}: {why}; {key} needs a PEM file", path.display())]
    File {
        /// The setting.
        key: &'static str,
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
    /// A key that is not the certificate's, or a root that is none.
    #[error("the certificates of [tls] cannot be used: {0}; give the key of the first certificate")]
    Unusable(String),
}

/// What connections are encrypted with now.
pub(super) type Current = watch::Receiver<Arc<ServerConfig>>;

/// Reads the certificates, and again when a file has changed. What cannot be used then is logged,
/// and the earlier certificates stay.
///
/// # Errors
/// Files that cannot be used at the start.
pub(super) fn certificates(files: TlsConfig) -> Result<Current, TlsError> {
    let paths = [Some(&files.certificate), Some(&files.key), files.client_ca.as_ref(), files.client_crl.as_ref()];
    let paths = paths.into_iter().flatten().cloned().collect();
    watched("certificates", paths, move || read(&files))
}

fn read(files: &TlsConfig) -> Result<ServerConfig, TlsError> {
    let TlsConfig { certificate, key, client_ca, client_crl } = files;
    let refused = |key, path: &Path| {
        let path = path.to_owned();
        move |error: pem::Error| TlsError::File { key, path, why: reason(&error) }
    };
    let chain = list("tls.certificate", certificate, "certificate")?;
    let private = PrivateKeyDer::from_pem_file(key).map_err(refused("tls.key", key))?;
    let unusable = |error: &dyn std::fmt::Display| TlsError::Unusable(error.to_string());
    let provider = Arc::new(ring::default_provider());
    let builder = ServerConfig::builder_with_provider(provider.clone());
    let builder = builder.with_safe_default_protocol_versions().map_err(|error| unusable(&error))?;
    let builder = match client_ca {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let mut roots = RootCertStore::empty();
            for root in list::<CertificateDer<'static>>("tls.client_ca", path, "certificate")? {
                roots.add(root).map_err(|error| unusable(&error))?;
            }
            let mut verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider);
            if let Some(path) = client_crl {
                let lists = list::<CertificateRevocationListDer<'static>>("tls.client_crl", path, "revocation list")?;
                verifier = verifier.with_crls(lists);
            }
            builder.with_client_cert_verifier(verifier.build().map_err(|error| unusable(&error))?)
        }
    };
    let mut config = builder.with_single_cert(chain, private).map_err(|error: rustls::Error| unusable(&error))?;
    config.alpn_protocols = vec![b"h2".to_vec()];
    Ok(config)
}

/// All of one kind in a file, of which there is at least one.
fn list<T: PemObject>(key: &'static str, path: &Path, kind: &str) -> Result<Vec<T>, TlsError> {
    let refused = |why: String| TlsError::File { key, path: path.to_owned(), why };
    let all = T::pem_file_iter(path).map_err(|error| refused(reason(&error)))?;
    let all: Vec<_> = all.collect::<Result<_, _>>().map_err(|error| refused(reason(&error)))?;
    if all.is_empty() { Err(refused(format!("holds no {kind}"))) } else { Ok(all) }
}

fn reason(error: &pem::Error) -> String {
    match error {
        pem::Error::Io(error) => error.to_string(),
        pem::Error::NoItemsFound => "holds no key".into(),
        other => format!("is damaged: {other}"),
    }
}
