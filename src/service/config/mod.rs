//! What a server is run with. Every setting has a default; a file, the environment and flags change
//! them, in this order.

mod error;
mod limits;
mod settings;
mod sources;

pub use error::ConfigError;
pub use limits::LimitsConfig;
pub use settings::{Config, LogConfig, LogFormat, TlsConfig};
pub use sources::{ENVIRONMENT, Flags, TlsFlags};
