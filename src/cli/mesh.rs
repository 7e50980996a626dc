//! Arguments of the commands that read meshes.

use crate::fit::{ReadError, ReadOptions, Reading, Scale, read_mesh};
use std::path::Path;

/// How to read a mesh or a point cloud.
#[derive(Clone, Copy, Debug, PartialEq, clap::Args)]
pub(super) struct MeshArgs {
    /// Metres per unit of the file: 0.001 for millimetres, or a factor for each axis such as
    /// 1,-1,1, which mirrors
    ///
    /// The unit that a COLLADA file names is applied in any case; this factor comes on top of it.
    #[arg(long, value_name = "FACTOR", default_value_t, allow_hyphen_values = true)]
    pub(super) scale: Scale,
    /// Leave out points with NaN or infinite coordinates, as scans have them, and say how many they
    /// are
    ///
    /// Without it such a point is an error. Faces that use one are left out with it.
    #[arg(long)]
    pub(super) drop_nan: bool,
    /// Leave out vertices that no triangle uses, of files with triangles
    ///
    /// Without it they count like all others, and it is reported by how much they enlarge the
    /// convex hull.
    #[arg(long)]
    pub(super) drop_unused: bool,
}

impl MeshArgs {
    /// Reads a file as the arguments say.
    pub(super) fn read(&self, path: &Path) -> Result<Reading, ReadError> {
        let Self { scale, drop_nan, drop_unused } = *self;
        read_mesh(path, &ReadOptions { scale, drop_nan, drop_unused })
    }

    /// Whether anything other than the defaults is asked for.
    pub(super) fn are_given(&self) -> bool {
        *self != Self { scale: Scale::default(), drop_nan: false, drop_unused: false }
    }
}

/// What is odd about a file, on standard error.
pub(super) fn note(path: &Path, reading: &Reading) {
    for sentence in reading.remarks.sentences(&reading.mesh) {
        eprintln!("note: {}: {sentence}", path.display());
    }
}
