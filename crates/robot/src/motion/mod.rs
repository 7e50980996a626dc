//! Motions that are proven to be free.
//!
//! On an interval of the path, with the configuration q in its middle and every value within w of
//! q, no point of a body moves farther than a bound Δ from where it is at q (Schwarzer, Saha,
//! Latombe, Adaptive dynamic collision checking for single and multiple manipulators in complex
//! environments, IEEE Trans. Robotics 21, 2005). A pair whose distance at q is more than Δ and its
//! threshold is free on the whole interval; one that is nearer than its threshold at q is in
//! contact; otherwise the interval is halved, and the halves inherit only the pairs that are open.
//! Every number is rounded so that the proof is valid. What proves a motion can be written down
//! ([`Certificate`]) and checked without a solver.

mod answer;
mod bound;
mod certificate;
mod certificate_error;
mod claim;
mod claim_of_problem;
mod derive;
#[cfg(fuzzing)]
pub mod fuzzing;
mod geometry;
mod interval;
mod path;
mod placing;
mod planes;
mod problem;
mod prove;
mod screw;
mod solve;
#[cfg(test)]
mod tests;
mod verify;
mod verify_options;

pub use answer::{MotionAnswer, MotionContact, MotionVerdict};
pub use certificate::Certificate;
pub use certificate_error::CertificateError;
pub use derive::{DEFAULT_DERIVE_RESOLUTION_M, DEFAULT_MAX_BOXES, DeriveOptions, DerivedPair, PairClass};
pub use geometry::{MotionBody, MotionItem, MotionObstacle, MotionShape, PlacedObstacle};
pub use path::{MAX_CONTROL_POINTS, MAX_PATH_POINTS, Path, PathError};
pub use problem::{MAX_PIECE_PAIRS, MotionProblem, MotionProblemError, MotionRobot};
pub use prove::{DEFAULT_MAX_CONFIGURATIONS, DEFAULT_RESOLUTION_M, MotionOptions, MotionWorkspace};
pub use verify::VerifiedMotion;
pub use verify_options::{KnownBodies, VerifyOptions};
