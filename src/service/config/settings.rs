//! The settings, and whether they go together.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::error::ConfigError;
use super::limits::LimitsConfig;
use crate::polynomial::{SimdLimit, limit_simd};

/// What a server is run with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Address to listen on; port 0 takes any free one.
    pub listen: SocketAddr,
    /// Directory of the catalogue; made when it is not there.
    pub data: PathBuf,
    /// Listens on a public address without TLS or without tokens.
    pub insecure: bool,
    /// Address of the listener for probes and metrics; none: there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub admin: Option<SocketAddr>,
    /// File with the tokens that clients may show; none: everybody may do everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tokens: Option<PathBuf>,
    /// Certificates; none: connections are not encrypted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tls: Option<TlsConfig>,
    /// Widest instructions that queries use, to compare them.
    pub simd: SimdConfig,
    /// What is logged, and how.
    pub log: LogConfig,
    /// Limits of connections and calls.
    pub limits: LimitsConfig,
}

/// Files of certificates, PEM. They are read again when they change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TlsConfig {
    /// The server's certificate and those between it and its root.
    pub certificate: PathBuf,
    /// Its private key.
    pub key: PathBuf,
    /// Roots of the certificates that clients have to show; none: clients need none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub client_ca: Option<PathBuf>,
    /// Lists of those that are revoked (CRL), one of each root and issuer; none: none is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub client_crl: Option<PathBuf>,
}

/// Widest instructions that queries use.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SimdConfig {
    /// The widest of the processor.
    Auto,
    /// AVX2 at most.
    Avx2,
    /// What every processor has.
    Baseline,
}

impl SimdConfig {
    /// Bounds the arithmetic of this process.
    pub(in crate::service) fn apply(self) {
        match self {
            Self::Auto => {}
            Self::Avx2 => limit_simd(SimdLimit::Avx2),
            Self::Baseline => limit_simd(SimdLimit::Baseline),
        }
    }
}

/// What is logged, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LogConfig {
    /// Least level (error, warn, info, debug, trace), or a filter of tracing-subscriber such as
    /// `info,sublevel::store=debug`.
    pub filter: String,
    /// Form of a line.
    pub format: LogFormat,
}

/// Form of a line of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: SocketAddr::from((Ipv4Addr::LOCALHOST, 50051)),
            data: "sublevel-data".into(),
            insecure: false,
            admin: None,
            tokens: None,
            tls: None,
            simd: SimdConfig::Auto,
            log: LogConfig::default(),
            limits: LimitsConfig::default(),
        }
    }
}

impl Default for LogConfig {
    fn default() -> Self {
        Self { filter: "info".into(), format: LogFormat::Text }
    }
}

impl Config {
    /// Whether the settings go together.
    ///
    /// # Errors
    /// The first one that cannot be used, by its name, with the remedy.
    pub fn check(&self) -> Result<(), ConfigError> {
        let refuse = |key: &str, why: String| Err(ConfigError::Setting { key: key.to_owned(), why });
        let public = !self.listen.ip().is_loopback();
        if public && !self.insecure && (self.tls.is_none() || self.tokens.is_none()) {
            let missing = if self.tls.is_none() { "[tls] is not set" } else { "tokens is not set" };
            let why = format!(
                "is {}, which others can reach, and {missing}: set it, listen on 127.0.0.1 or [::1], or say \
                 --insecure",
                self.listen
            );
            return refuse("listen", why);
        }
        if self.admin.is_some_and(|admin| admin == self.listen && admin.port() != 0) {
            return refuse("admin", format!("is {}, which is the address of listen; choose another port", self.listen));
        }
        if self.tls.as_ref().is_some_and(|tls| tls.client_crl.is_some() && tls.client_ca.is_none()) {
            let why = "is set, and tls.client_ca is not: no client is asked for a certificate; name the roots";
            return refuse("tls.client_crl", why.into());
        }
        if self.data.as_os_str().is_empty() {
            return refuse("data", "is empty; name a directory".into());
        }
        self.limits.check()
    }

    /// As a file of settings.
    pub fn to_toml(&self) -> String {
        // Strings, numbers and tables only: all of it can be written.
        toml::to_string(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_printed_is_what_is_read() {
        let all = Config {
            admin: Some(([127, 0, 0, 1], 9000).into()),
            tokens: Some("tokens.toml".into()),
            tls: Some(TlsConfig {
                certificate: "a.pem".into(),
                key: "b.pem".into(),
                client_ca: Some("c.pem".into()),
                client_crl: Some("d.pem".into()),
            }),
            ..Config::default()
        };
        for config in [Config::default(), all] {
            assert_eq!(toml::from_str::<Config>(&config.to_toml()).expect("read again"), config);
        }
    }

    #[test]
    fn a_public_address_needs_certificates_and_tokens() {
        let public = Config { listen: ([0, 0, 0, 0], 1).into(), ..Config::default() };
        let why = public.check().expect_err("public").to_string();
        assert!(why.contains("listen is 0.0.0.0:1") && why.contains("[tls]") && why.contains("--insecure"), "{why}");
        assert!(Config { insecure: true, ..public.clone() }.check().is_ok());
        let files = TlsConfig { certificate: "a".into(), key: "b".into(), client_ca: None, client_crl: None };
        let revoking = Some(TlsConfig { client_crl: Some("d".into()), ..files.clone() });
        let encrypted = Config { tls: Some(files), ..public };
        assert!(encrypted.check().expect_err("no tokens").to_string().contains("tokens is not set"));
        assert!(Config { tokens: Some("t".into()), ..encrypted }.check().is_ok());
        let why = Config { tls: revoking, ..Config::default() }.check().expect_err("no roots").to_string();
        assert!(why.contains("tls.client_crl") && why.contains("tls.client_ca"), "{why}");
        let twice = Config { admin: Some(Config::default().listen), ..Config::default() };
        assert!(twice.check().expect_err("one address").to_string().starts_with("admin is"));
    }
}
