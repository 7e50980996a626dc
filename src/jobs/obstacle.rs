//! Stored bodies that jobs take as sets.

use crate::body::{BodyId, Obstacle, Shape};
use crate::scene::Geometry;
use crate::store::{Catalogue, CatalogueError};

/// What is no single set of polynomials.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotASet {
    /// A union.
    #[error("is a compound, a union of bodies; name its parts one by one, as bodies of their own")]
    Compound,
    /// Several levels of detail.
    #[error("is a ladder, several bodies around one object; name one of its rungs")]
    Ladder,
    /// The set of no polynomials.
    #[error("is a capsule, which no polynomial describes; name a cylinder or an ellipsoid around it")]
    Capsule,
    /// Unbounded.
    #[error("is a half-space, which is unbounded; name a box that reaches as far as is needed")]
    HalfSpace,
}

/// The set of a stored body: bodies and sos-bodies are one.
///
/// # Errors
/// What it is instead.
pub fn obstacle(geometry: &Geometry) -> Result<Obstacle, NotASet> {
    match geometry {
        Geometry::Solid(shape) => match &**shape {
            Shape::Body(body) => Ok(Obstacle::from((**body).clone())),
            Shape::Compound(_) => Err(NotASet::Compound),
        },
        Geometry::SosBody(body) => Ok(Obstacle::from((**body).clone())),
        Geometry::Ladder(_) => Err(NotASet::Ladder),
        Geometry::Capsule(_) => Err(NotASet::Capsule),
        Geometry::HalfSpace(_) => Err(NotASet::HalfSpace),
    }
}

/// The set of a body that a job is about; an error is the reason why the job fails.
pub(super) fn stored_obstacle(catalogue: &Catalogue, id: &BodyId) -> Result<Obstacle, String> {
    let geometry = catalogue.geometry(id).map_err(|error| match error {
        CatalogueError::NoBody(_) => format!("body {id} was deleted meanwhile; create it again"),
        error => error.to_string(),
    })?;
    obstacle(&geometry).map_err(|error| format!("body {id} {error}"))
}
