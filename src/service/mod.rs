//! The gRPC door: handlers, conversion between wire and domain, limits, errors, starting and
//! stopping.
//!
//! The one layer that knows protobuf. `incoming` lets connections in and `concurrency_limit` calls,
//! so many at once. A call walks straight through: a handler (`bodies`, `scenes`, `queries`,
//! `fits`) reads its message with `wire`, asks the catalogue or a scene's snapshot, and writes the
//! answer with `wire`; whatever fails becomes a status in `error`. Handlers are dropped when a
//! client goes away, so every change runs in a task of its own and is finished or not begun.

mod app_state;
mod bodies;
mod concurrency_limit;
mod error;
#[cfg(feature = "fit")]
mod fits;
mod incoming;
pub mod limits;
pub mod proto;
mod push;
mod queries;
mod scenes;
mod server;
mod wire;

#[cfg(feature = "fit")]
pub use fits::{SubmitError, submit};
pub use push::{PushError, Pushed, push};
pub use server::{ServeError, ServeOptions, Server, serve};
