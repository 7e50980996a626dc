//! Where settings come from: defaults, then a file, then the environment, then flags.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use figment::Figment;
use figment::providers::{Env, Format, Serialized, Toml};
use serde::Serialize;

use super::error::ConfigError;
use super::settings::Config;

/// Beginning of the variables of the environment: `SUBLEVEL_SERVER_LISTEN`, and with two
/// underscores for a table, `SUBLEVEL_SERVER_LIMITS__CALLS`.
pub const ENVIRONMENT: &str = "SUBLEVEL_SERVER_";

/// Settings that were given as flags.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Flags {
    /// See [`Config::listen`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub listen: Option<SocketAddr>,
    /// See [`Config::data`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub data: Option<PathBuf>,
    /// See [`Config::insecure`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub insecure: Option<bool>,
    /// See [`Config::admin`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub admin: Option<SocketAddr>,
    /// See [`Config::tokens`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tokens: Option<PathBuf>,
    /// See [`Config::tls`].
    #[serde(skip_serializing_if = "TlsFlags::is_empty")]
    pub tls: TlsFlags,
}

/// Files of certificates that were given as flags.
#[derive(Clone, Debug, Default, Serialize)]
pub struct TlsFlags {
    /// See [`TlsConfig::certificate`](super::settings::TlsConfig::certificate).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certificate: Option<PathBuf>,
    /// See [`TlsConfig::key`](super::settings::TlsConfig::key).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<PathBuf>,
    /// See [`TlsConfig::client_ca`](super::settings::TlsConfig::client_ca).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub client_ca: Option<PathBuf>,
    /// See [`TlsConfig::client_crl`](super::settings::TlsConfig::client_crl).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub client_crl: Option<PathBuf>,
}

impl TlsFlags {
    fn is_empty(&self) -> bool {
        [&self.certificate, &self.key, &self.client_ca, &self.client_crl].into_iter().all(Option::is_none)
    }
}

impl Config {
    /// The settings: defaults, then those of a file, of the environment, and of flags.
    ///
    /// # Errors
    /// A file that cannot be read, unknown keys, values of another kind, and settings that do not
    /// go together.
    pub fn load(file: Option<&Path>, flags: &Flags) -> Result<Self, ConfigError> {
        let mut sources = Figment::from(Serialized::defaults(Self::default()));
        if let Some(path) = file {
            let text =
                std::fs::read_to_string(path).map_err(|source| ConfigError::File { path: path.to_owned(), source })?;
            // Read here: figment takes a file that is not there for an empty one.
            sources = sources.merge(Toml::string(&text));
        }
        if let Ok(filter) = std::env::var("RUST_LOG") {
            sources = sources.merge(("log.filter", filter));
        }
        if let Ok(simd) = std::env::var("SUBLEVEL_SIMD") {
            sources = sources.merge(("simd", simd));
        }
        sources = sources.merge(Env::prefixed(ENVIRONMENT).split("__"));
        let config: Self =
            sources.merge(Serialized::globals(flags)).extract().map_err(|error| explained(&error, file))?;
        config.check()?;
        Ok(config)
    }
}

/// The first reason, with the key and where it stands.
fn explained(error: &figment::Error, file: Option<&Path>) -> ConfigError {
    let key = error.path.join(".");
    let place = match &error.metadata {
        Some(metadata) if metadata.name.contains("environment") => {
            format!("{ENVIRONMENT}{}: ", error.path.join("__").to_uppercase())
        }
        Some(metadata) if metadata.name.contains("TOML") => {
            file.map_or_else(String::new, |file| format!("{}: ", file.display()))
        }
        _ => String::new(),
    };
    let key = if key.is_empty() { key } else { format!("{key}: ") };
    ConfigError::Source(format!("{place}{key}{}; --print-config shows all keys", in_one_line(&error.kind.to_string())))
}

/// Without the picture of the place that is in errors of TOML.
fn in_one_line(text: &str) -> String {
    let is_picture = |line: &&str| {
        line.contains('|')
            && line.split('|').next().is_some_and(|number| number.trim().chars().all(|c| c.is_ascii_digit()))
    };
    text.lines()
        .filter(|line| !is_picture(line))
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn file(text: &str) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        file.write_all(text.as_bytes()).expect("written");
        file
    }

    #[test]
    fn flags_come_before_the_file_and_the_file_before_defaults() {
        let file = file("listen = \"127.0.0.1:1\"\ndata = \"there\"\n[limits]\ncalls = 7\n");
        let flags = Flags { listen: Some(([127, 0, 0, 1], 2).into()), ..Flags::default() };
        let config = Config::load(Some(file.path()), &flags).expect("settings");
        assert_eq!((config.listen.port(), &config.data), (2, &PathBuf::from("there")));
        assert_eq!((config.limits.calls, config.limits.connections), (7, Config::default().limits.connections));
        assert_eq!(Config::load(None, &Flags::default()).expect("defaults"), Config::default());
    }

    #[test]
    fn what_is_no_setting_is_refused_by_name() {
        let refused = |text: &str| {
            let file = file(text);
            let error = Config::load(Some(file.path()), &Flags::default()).expect_err(text).to_string();
            assert!(!error.contains('\n'), "{error}");
            error
        };
        let unknown = refused("lisen = \"127.0.0.1:1\"\n");
        assert!(unknown.contains("lisen") && unknown.contains("listen") && unknown.contains("tmp"), "{unknown}");
        assert!(refused("[limits]\ncallz = 1\n").contains("callz"));
        let kind = refused("[limits]\ncalls = \"many\"\n");
        assert!(kind.contains("limits.calls") && kind.contains("many"), "{kind}");
        assert!(refused("listen = 5\n").contains("listen"));
        assert!(refused("[tls]\nkey = \"k\"\n").contains("certificate"));
        assert!(refused("listen = \"0.0.0.0:5\"\n").contains("--insecure"));
        assert!(refused("= 5\n").contains("TOML"));
        let absent = Config::load(Some(Path::new("/nowhere/at.toml")), &Flags::default()).expect_err("absent");
        assert!(absent.to_string().contains("/nowhere/at.toml"), "{absent}");
    }
}
