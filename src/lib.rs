//! Sublevel: collision and proximity queries on certified convex polynomial bodies.
//!
//! A body is a set `{x : g_1(x) <= 1, ..., g_m(x) <= 1}` of sos-convex polynomials that were fitted
//! around an object offline. Distances between moving bodies are small convex programs, solved here
//! in microseconds, and every answer is a bracket proven to contain the truth.

/// The README's example, kept true by the doc tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub use sublevel_core::{body, branch_and_bound, measure, optimize, polynomial};
#[cfg(feature = "fit")]
pub use sublevel_fit as fit;
pub use sublevel_robot as robot;
pub use sublevel_scene as scene;

pub mod cli;
pub mod client;
#[cfg(feature = "fit")]
pub mod demo;
pub mod draw;
#[cfg(feature = "fit")]
pub mod jobs;
pub mod load;
pub mod service;
pub mod store;
