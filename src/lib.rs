//! Sublevel
