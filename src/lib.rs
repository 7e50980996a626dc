//! Sublevel
pub mod chart;
pub mod demo;
