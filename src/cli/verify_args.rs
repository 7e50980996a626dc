//! Arguments of `sublevel verify`.

#[cfg(feature = "fit")]
use super::mesh::MeshArgs;
use std::path::PathBuf;

/// Re-prove a body or a compound from its stored numbers alone
///
/// Recomputes the id, checks every certificate (no program is solved), proves the body bounded and
/// compares every derived value but gap_m, which needs the object. With --points it also proves
/// that every point of a mesh is inside, and bounds again how far the body reaches beyond their
/// convex hull. With --contains it proves that whole bodies are inside. Of a compound every part is
/// re-proven, and with --points that it covers all triangles of the mesh, and what they enclose if
/// they are closed: the mesh is cut again as the file says, and each part must hold its piece. Exit
/// code 0 only if every claim is proven.
///
/// An sos-body, which need not be convex, is proven to be of a sum of squares and as near to convex
/// as it says; with --points, to contain the points, and no fewer triangles between them than it
/// says.
///
/// A certificate of a motion, as CheckMotions sends it, is checked without a solver: every body is
/// re-proven, and the motion of the robot is proven to be free once more.
///
/// Examples:
///
/// sublevel verify bodies/mug-d6.json --points mug.obj --scale 0.001
///
/// sublevel verify bodies/shelf-d4.json --contains board-1.json board-2.json
#[derive(Debug, clap::Args)]
pub(super) struct VerifyArgs {
    /// File of a body, a compound, an sos-body, or a certificate of a motion
    pub(super) file: PathBuf,
    /// Mesh or points that the body must contain, mesh that the compound must cover
    #[cfg(feature = "fit")]
    #[arg(long, value_name = "MESH")]
    pub(super) points: Option<PathBuf>,
    #[cfg(feature = "fit")]
    #[command(flatten)]
    pub(super) mesh: MeshArgs,
    /// Bodies and sos-bodies that the body must contain whole, by the proofs that its file keeps
    /// for them
    #[cfg_attr(feature = "fit", doc = "or, if it has none, by new ones")]
    #[arg(long, value_name = "FILE", num_args = 1..)]
    pub(super) contains: Vec<PathBuf>,
    /// Print one JSON object instead of sentences
    #[arg(long)]
    pub(super) json: bool,
}
