//! The commands: arguments in, tables or JSON out, errors as one line.

pub mod push;
pub mod serve;
