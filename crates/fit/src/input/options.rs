//! How to read a file.

use super::scale::Scale;

/// How to read a file.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Metres per unit of the file. COLLADA files name their unit: there it comes on top.
    pub scale: Scale,
    /// Leave out points with a coordinate that is not finite, as scans have them where nothing was
    /// seen, with the faces that use them; else they are an error.
    pub drop_nan: bool,
    /// Leave out vertices that no triangle uses, of files with triangles.
    pub drop_unused: bool,
}
