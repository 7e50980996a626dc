//! The command line of sublevel.
fn main() {}
