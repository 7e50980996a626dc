//! The gRPC door: handlers, conversion between wire and domain, limits, errors, starting and
//! stopping.
//!
//! Only this layer and the client know protobuf. `incoming` lets connections in,
//! `concurrency_limit` calls, and `message_limit` messages. A call walks straight through: a
//! handler (`bodies`, `blobs`, `scenes`, `queries`, `fits`, `hierarchy`, `jobs`) reads its message
//! with a `wire`, asks the catalogue or a scene's snapshot, and writes the answer with the `wire`;
//! whatever fails becomes a status in `error`. Handlers are dropped when a client goes away, so
//! every change runs in a task of its own and is finished or not begun, and every question is
//! stopped.

mod admin;
mod admin_listener;
mod answer_body;
pub(crate) mod answer_wire;
mod app_state;
mod authorization;
mod backups;
mod blob_calls;
mod blobs;
mod bodies;
mod body_mesh;
mod body_wire;
mod call_layer;
mod call_time;
mod calls;
mod columns;
mod concurrency_limit;
pub mod config;
mod contact_watch;
#[cfg(feature = "fit")]
pub(crate) mod derive_wire;
pub(crate) mod error;
mod explain;
#[cfg(feature = "fit")]
pub(crate) mod fits;
#[cfg(fuzzing)]
pub mod fuzzing;
#[cfg(feature = "fit")]
pub(crate) mod hierarchy;
mod incoming;
#[cfg(feature = "fit")]
mod job_metrics;
#[cfg(feature = "fit")]
pub(crate) mod job_wire;
#[cfg(feature = "fit")]
mod jobs;
pub mod limits;
#[cfg(feature = "fit")]
mod link_fits;
mod message_limit;
mod metrics;
mod motions;
pub(crate) mod packed;
mod placed_states;
mod pose_stream;
pub mod proto;
mod queries;
pub(crate) mod query_wire;
mod reason;
mod request_body;
pub(crate) mod robot_wire;
mod robots;
mod scene_watch;
pub(crate) mod scene_wire;
mod scenes;
mod server;
mod server_info;
mod snapshot;
mod state_reasons;
mod tls;
pub(crate) mod tokens;
mod watched_files;
pub(crate) mod wire;

pub use config::Config;
pub use reason::Reason;
pub use server::{ServeError, Server, serve};
pub use tls::TlsError;
pub use tokens::{Role, TokensError};
