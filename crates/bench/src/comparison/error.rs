//! Why a figure cannot be made.

use super::{FitCacheError, NoHull, PeerError};
use sublevel::draw::ChartError;
use sublevel::fit::{ReadError, hull::HullError};
use sublevel::measure::{OptionsError, PoseError};

/// Why there is no figure.
#[derive(Debug, thiserror::Error)]
pub enum ComparisonError {
    /// A mesh cannot be read.
    #[error("{0}; name the folder that has psb/101.off and meshes/mbm_mug.off with --data")]
    Mesh(#[from] ReadError),
    /// A mesh has no hull.
    #[error("{mesh}: {source}")]
    Hull {
        /// The mesh.
        mesh: &'static str,
        /// What is wrong with it.
        source: HullError,
    },
    /// A representation cannot be made.
    #[error("{mesh}, {method}: {what}")]
    Representation {
        /// The mesh.
        mesh: &'static str,
        /// The representation.
        method: String,
        /// Why not.
        what: String,
    },
    /// Fits cannot be made or kept.
    #[error(transparent)]
    FitCache(#[from] FitCacheError),
    /// Parry makes no mesh of it.
    #[error("{mesh}: parry makes no mesh of it: {what}")]
    ParryMesh {
        /// The mesh.
        mesh: &'static str,
        /// What it said.
        what: String,
    },
    /// Parry makes no hull.
    #[error(transparent)]
    NoHull(#[from] NoHull),
    /// Coal or clarabel cannot be timed.
    #[error(transparent)]
    Peer(#[from] PeerError),
    /// A child cannot be started or read.
    #[error("{}: {source}", program.display())]
    Child {
        /// The program.
        program: std::path::PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Messages to a server cannot be timed.
    #[error("timing messages to a server on loopback: {0}")]
    Messages(String),
    /// An accuracy is none.
    #[error(transparent)]
    Options(#[from] OptionsError),
    /// A pose is none.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Stopped by the caller.
    #[error("the chart was cancelled")]
    Cancelled,
    /// A picture failed.
    #[error(transparent)]
    Chart(#[from] ChartError),
}
