//! The server as its users meet it: a real process, gRPC, signals, and a disk.

mod answers;
#[cfg(feature = "fit")]
mod fits;
mod harness;
mod keeping;
mod lifecycle;
mod load;
mod refusals;
