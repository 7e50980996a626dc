//! Why a text is not a valid body file.

use super::body_error::BodyError;
use super::compound::CompoundError;
use super::sos::SosBodyError;

/// Why a text is not a valid body file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyFileError {
    /// Not JSON, or not of this shape.
    #[error("not a body file: {0}; write it with 'sublevel fit' or see the format in the README")]
    Json(String),
    /// Another format or kind.
    #[error("{field} is {found:?} but this version reads {expected:?}; use a matching version of sublevel")]
    Format {
        /// Key in the file.
        field: &'static str,
        /// Value in the file.
        found: String,
        /// Value that this version reads.
        expected: &'static str,
    },
    /// A defining value is not valid.
    #[error("{field}: {reason}")]
    Field {
        /// Key in the file.
        field: String,
        /// What is wrong with it, with the remedy.
        reason: String,
    },
    /// A stored value that is derived from others differs from what they give.
    #[error(
        "{field} does not follow from the polynomials: stored {stored}, recomputed {recomputed}; the file was changed, fit the body again"
    )]
    Derived {
        /// Key in the file.
        field: &'static str,
        /// Value in the file.
        stored: String,
        /// Value that follows.
        recomputed: String,
    },
    /// The proof fails.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The set of an sos-body where a convex body is needed.
    #[error(
        "kind is \"sos-body\": its set need not be convex, so that what bounds distances of convex bodies proves nothing of it; \
         fit a convex body to the same object ('sublevel fit' without --relax-convexity and inverse-moment)"
    )]
    NotConvex,
    /// The proof of an sos-body fails.
    #[error(transparent)]
    SosBody(#[from] SosBodyError),
    /// A part of a compound is wrong.
    #[error("parts[{index}]: {source}")]
    Part {
        /// Which part.
        index: usize,
        /// What is wrong with it.
        source: Box<BodyFileError>,
    },
    /// The parts do not make a compound.
    #[error(transparent)]
    Compound(#[from] CompoundError),
}
