//! Comparisons: representations of the same objects walk the same poses and are timed in turns,
//! ours and those of other libraries.
//!
//! Figures and `cargo bench -p sublevel-bench --bench measures` share this: motions ([`motion`]),
//! timed rows ([`sweep`]), the peers ([`Hulls`] of parry in this process, [`Coal`] in one of its
//! own), and fits that are kept between runs ([`FitCache`]).

mod coal;
mod error;
mod fit_cache;
pub mod motion;
mod parry;
mod parry_shape;
pub(crate) mod peer;
mod peer_shape;
mod random;
mod subject;
pub mod sweep;

pub use coal::{Coal, CoalRun};
pub(crate) use coal::{points_text, version_beside};
pub use error::ComparisonError;
pub use fit_cache::{FitCache, FitCacheError};
pub use parry::{Hulls, NoHull, parry_impact, parry_pose, parry_version};
pub(crate) use parry_shape::ParryShape;
pub use peer::PeerError;
pub use peer_shape::PeerShape;
pub use random::Random;
pub use subject::{Subject, pairs};
