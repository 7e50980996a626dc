//! Why batches are refused.

/// Why a batch is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BatchError {
    /// No poses.
    #[error("the batch is empty; give at least one pose")]
    Empty,
    /// Not a place for every answer.
    #[error("{poses} poses but places for {answers} answers; give one place for each pose")]
    Lengths {
        /// Number of poses.
        poses: usize,
        /// Number of places for answers.
        answers: usize,
    },
    /// The sides have different numbers of poses, and neither has one.
    #[error(
        "{solid} poses of the solid but {capsule} of the capsule; give as many of both, or one that stands for all"
    )]
    Sides {
        /// Number of poses of the solid.
        solid: usize,
        /// Number of poses of the capsule.
        capsule: usize,
    },
}
