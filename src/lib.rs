//! Sublevel: collision and proximity queries on certified convex polynomial bodies.
//!
//! A body is a set `{x : g_1(x) <= 1, ..., g_m(x) <= 1}` of sos-convex polynomials that were fitted around an object
//! offline. Distances between moving bodies are small convex programs, solved here in microseconds, and every answer is
//! a bracket proven to contain the truth.

/// The README's example, kept true by the doc tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

pub mod body;
pub mod chart;
pub mod cli;
#[cfg(feature = "chart")]
pub mod demo;
#[cfg(feature = "fit")]
pub mod fit;
#[cfg(feature = "fit")]
pub mod jobs;
pub mod measure;
pub mod optimize;
pub mod polynomial;
pub mod scene;
pub mod service;
pub mod store;
