//! Bodies of the links of a robot that have meshes.

use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::{Point3, Vector3};

use super::execute::{Failure, Shapes, fit_mesh};
use super::request::{RequestError, check};
use crate::body::{Body, Compound, CompoundError, Shape};
use crate::fit::Mesh;
use crate::robot::{Collision, Geometry as Piece, Link};
use crate::scene::{PrimitiveError, primitive_bodies};
use crate::store::{FitBody, FitMode, FitPolynomial, FitPreparation, FitRequest, FitWithinGap};

/// How links with meshes become bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LinkFit {
    /// The cheapest representation that reaches at most so far, metres, beyond the convex hull of
    /// the link, or of the parts of this.
    WithinGap(f64),
    /// One body of this degree.
    Degree(usize),
}

/// Why a link has no body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LinkBodyError {
    /// Options that cannot be used.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// Meshes that cannot be fitted.
    #[error(transparent)]
    Fit(#[from] Failure),
    /// What is no mesh of the link, and no body.
    #[error(transparent)]
    Primitive(#[from] PrimitiveError),
    /// More parts than a compound has.
    #[error(transparent)]
    Compound(#[from] CompoundError),
    /// The fit made no convex bodies.
    #[error("the fit made a set that need not be convex; links need convex bodies")]
    NotConvex,
}

/// Whether a link has a mesh among its collision elements.
pub fn has_mesh(link: &Link) -> bool {
    link.collisions.iter().any(|piece| matches!(piece.geometry, Piece::Mesh { .. }))
}

/// All meshes of a link in its frame, metres; `read` reads the file that the description names.
///
/// # Errors
/// What `read` says.
pub fn link_mesh<E>(link: &Link, mut read: impl FnMut(&str) -> Result<Arc<Mesh>, E>) -> Result<Mesh, E> {
    let mut joined = Mesh { points: Vec::new(), triangles: Vec::new() };
    for Collision { origin, geometry } in &link.collisions {
        let Piece::Mesh { uri, scale } = geometry else { continue };
        let mesh = read(uri)?;
        let first = joined.points.len();
        let placed = |point: &Vector3<f64>| (origin * Point3::from(point.component_mul(scale))).coords;
        joined.points.extend(mesh.points.iter().map(placed));
        // A mirrored triangle is seen from behind.
        let is_mirrored = scale.iter().filter(|factor| **factor < 0.0).count() % 2 == 1;
        joined.triangles.extend(mesh.triangles.iter().map(|&[a, b, c]| {
            let [b, c] = if is_mirrored { [c, b] } else { [b, c] };
            [a, b, c].map(|corner| corner + first)
        }));
    }
    Ok(joined)
}

/// What is asked for of a link.
///
/// # Errors
/// The option that cannot be used.
pub fn link_request(link: &str, fit: LinkFit) -> Result<FitRequest, RequestError> {
    let (polynomial, preparation) = (FitPolynomial::default(), FitPreparation::default());
    let mode: FitMode = match fit {
        LinkFit::Degree(degree) => {
            let polynomial = FitPolynomial { degree: Some(degree), ..polynomial };
            FitBody { polynomial, slabs: 0, preparation }.into()
        }
        LinkFit::WithinGap(max_gap_m) => FitWithinGap { max_gap_m, polynomial, preparation }.into(),
    };
    let request = FitRequest::new(link, mode);
    check("", &request)?;
    Ok(request)
}

/// A body around all meshes of a link, in its frame, with what is no mesh of the link exactly.
/// `progress` is called at every step, and can stop it.
///
/// # Errors
/// What cannot be fitted, and why.
pub fn fit_link(
    link: &Link,
    mesh: Mesh,
    fit: LinkFit,
    mut progress: impl FnMut() -> ControlFlow<()>,
) -> Result<Shape, LinkBodyError> {
    let request = link_request(&link.name, fit)?;
    let exact = exact_parts(link)?;
    let made = fit_mesh(&request, mesh, |_, _| progress())?;
    let mut parts = match made.shapes {
        Shapes::Compound(compound) if exact.is_empty() => return Ok(Shape::Compound(compound)),
        Shapes::Compound(compound) => compound.parts().to_vec(),
        Shapes::Bodies(bodies) => bodies,
        Shapes::SosBody(_) => return Err(LinkBodyError::NotConvex),
    };
    parts.extend(exact);
    Ok(match parts.len() {
        1 => Shape::Body(Box::new(parts.remove(0))),
        _ => Shape::Compound(Box::new(Compound::new(&link.name, parts)?)),
    })
}

/// Bodies of what is no mesh of a link, exactly.
///
/// # Errors
/// Sizes or a place that no body can have.
pub fn exact_parts(link: &Link) -> Result<Vec<Body>, PrimitiveError> {
    let primitives = link.collisions.iter().filter(|piece| !matches!(piece.geometry, Piece::Mesh { .. }));
    let mut parts = Vec::new();
    for piece in primitives {
        parts.extend(primitive_bodies(&link.name, piece)?);
    }
    Ok(parts)
}
