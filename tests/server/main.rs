//! The server as its users meet it: a real process, gRPC, signals, and a disk.

mod answers;
mod data;
mod deadlines;
mod families;
#[cfg(feature = "fit")]
mod fits;
mod harness;
#[cfg(feature = "fit")]
mod hierarchy;
mod hostile;
mod keeping;
mod kills;
mod lifecycle;
mod load;
mod open_loop;
mod operation;
mod operations_page;
mod readme;
mod refusals;
mod robots;
mod soak;
mod streams;
#[cfg(feature = "fit")]
mod tutorial;
