//! The geometry of a link from the primitives of a description.

use nalgebra::{Isometry3, Vector3};
use sublevel_core::body::{Body, BodyError, Compound, CompoundError};
use sublevel_core::measure::{Capsule, CapsuleError};
use sublevel_robot::{Collision, Geometry as Piece};

use crate::{Geometry, NamedCapsule};

/// Why primitives make no geometry.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PrimitiveError {
    /// A mesh, which is no primitive.
    #[error("is a mesh")]
    Mesh,
    /// Sizes or a place that no body can have.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// Sizes that no capsule can have.
    #[error(transparent)]
    Capsule(#[from] CapsuleError),
    /// Too many pieces.
    #[error(transparent)]
    Compound(#[from] CompoundError),
}

/// The union of the pieces of a link in the frame of the link, exactly; none of a link without
/// pieces. The error comes with the position of the piece.
pub(super) fn geometry(link: &str, pieces: &[Collision]) -> Result<Option<Geometry>, (usize, PrimitiveError)> {
    let mut parts = Vec::new();
    for (index, piece) in pieces.iter().enumerate() {
        if let ([_], Some(capsule)) = (pieces, upright(piece)) {
            let capsule = capsule.and_then(|capsule| Ok(NamedCapsule::new(link, capsule)?));
            return capsule.map(|capsule| Some(capsule.into())).map_err(|error| (index, error));
        }
        parts.extend(primitive_bodies(link, piece).map_err(|error| (index, error))?);
    }
    if parts.len() > 1 {
        let compound = Compound::new(link, parts).map_err(|error| (pieces.len() - 1, error.into()))?;
        return Ok(Some(compound.into()));
    }
    Ok(parts.pop().map(Geometry::from))
}

/// A capsule that lies about the z axis of the link, where capsules have their axes.
fn upright(piece: &Collision) -> Option<Result<Capsule, PrimitiveError>> {
    let Piece::Capsule { radius_m, length_m } = piece.geometry else { return None };
    let (rotation, translation) = (&piece.origin.rotation, &piece.origin.translation.vector);
    let keeps_the_axis = rotation.i == 0.0 && rotation.j == 0.0;
    (keeps_the_axis && *translation == Vector3::zeros()).then(|| Ok(Capsule::new(radius_m, 0.5 * length_m)?))
}

/// A primitive as bodies in the frame of the link: of a capsule the cylinder and two balls whose
/// union it is.
///
/// # Errors
/// A mesh, and sizes or a place that no body can have.
pub fn primitive_bodies(link: &str, piece: &Collision) -> Result<Vec<Body>, PrimitiveError> {
    let place = |body: Body| placed(&body.with_gap(0.0), &piece.origin);
    let ball = |z: f64, radius: f64| place(Body::ball(link, Vector3::new(0.0, 0.0, z), radius)?);
    let cylinder = |radius: f64, length: f64| place(Body::cylinder(link, radius, 0.5 * length)?);
    Ok(match piece.geometry {
        Piece::Box { sides_m } => vec![place(Body::cuboid(link, sides_m * 0.5)?)?],
        Piece::Cylinder { radius_m, length_m } => vec![cylinder(radius_m, length_m)?],
        Piece::Sphere { radius_m } => vec![ball(0.0, radius_m)?],
        Piece::Capsule { radius_m, length_m: 0.0 } => vec![ball(0.0, radius_m)?],
        Piece::Capsule { radius_m, length_m } => {
            vec![cylinder(radius_m, length_m)?, ball(0.5 * length_m, radius_m)?, ball(-0.5 * length_m, radius_m)?]
        }
        Piece::Mesh { .. } => return Err(PrimitiveError::Mesh),
    })
}

fn placed(body: &Body, origin: &Isometry3<f64>) -> Result<Body, PrimitiveError> {
    if *origin == Isometry3::identity() {
        return Ok(body.clone());
    }
    Ok(body.moved(&origin.rotation, &origin.translation.vector)?)
}
