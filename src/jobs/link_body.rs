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
    /// One body of this degree, of the least volume that is found.
    Degree(usize),
}

impl Default for LinkFit {
    /// Of what was fitted to the links of an arm, one body of degree 6 kept as many states free
    /// as two bodies did, and was as fast as coarser ones (`docs/panda.md`).
    fn default() -> Self {
        Self::Degree(6)
    }
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
            let polynomial = FitPolynomial { degree: Some(degree), refine: true, ..polynomial };
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

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, UnitQuaternion};
    use sublevel_testkit::Seeded;

    use super::*;
    use crate::robot::read_urdf;

    /// Three edges along the axes, 1, 2 and 3 m, and the triangles between them as they are seen
    /// from outside. Its volume is 1 m³, and no mirror image of it is a rotated copy.
    fn tetrahedron() -> Arc<Mesh> {
        let points = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]].map(Vector3::from);
        Arc::new(Mesh { points: points.into(), triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]] })
    }

    /// The volume that triangles enclose, m³; negative where they are seen from inside.
    fn volume_m3(mesh: &Mesh) -> f64 {
        let of = |corners: &[usize; 3]| {
            let [a, b, c] = corners.map(|corner| mesh.points[corner]);
            a.dot(&b.cross(&c)) / 6.0
        };
        mesh.triangles.iter().map(of).sum()
    }

    #[test]
    fn meshes_of_links_are_scaled_mirrored_and_placed() {
        // Scaled and mirrored first; then a quarter turn about x and one about z take x, y, z to
        // z, x, y.
        let urdf = r#"<robot name="robot"><link name="link">
          <collision><origin xyz="1 2 3" rpy="1.5707963267948966 0 1.5707963267948966"/>
            <geometry><mesh filename="mirrored.stl" scale="1 -1 3"/></geometry></collision>
          <collision><geometry><sphere radius="1"/></geometry></collision>
          <collision><geometry><mesh filename="plain.stl"/></geometry></collision>
        </link></robot>"#;
        let description = read_urdf(urdf).expect("a robot");
        let [link] = &description.links[..] else { panic!("{description:?}") };
        let mut files = Vec::new();
        let mesh = link_mesh(link, |uri| {
            files.push(uri.to_owned());
            Ok::<_, String>(tetrahedron())
        });
        let mesh = mesh.expect("a mesh");
        assert_eq!(files, ["mirrored.stl", "plain.stl"]);
        let mirrored = [[1.0, 2.0, 3.0], [1.0, 3.0, 3.0], [1.0, 2.0, 1.0], [10.0, 2.0, 3.0]].map(Vector3::from);
        let expected = [&mirrored[..], &tetrahedron().points].concat();
        assert_eq!(mesh.points.len(), expected.len());
        for (point, expected) in mesh.points.iter().zip(&expected) {
            assert!((point - expected).norm() < 1e-13, "{point} {expected}");
        }
        // Two corners of each mirrored triangle change places; the others come behind them.
        let mirrored = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
        let plain = [[4, 6, 5], [4, 5, 7], [4, 7, 6], [5, 6, 7]];
        assert_eq!(mesh.triangles, [mirrored, plain].concat());
        assert!((volume_m3(&mesh) - 4.0).abs() < 1e-12, "three times the volume, and once: {}", volume_m3(&mesh));
        let refused = link_mesh(link, |uri| if uri == "plain.stl" { Err("gone") } else { Ok(tetrahedron()) });
        assert_eq!(refused, Err("gone"));
    }

    /// For every choice of mirrored axes: triangles of a mesh that is seen from inside out would
    /// enclose a negative volume.
    #[test]
    fn mirrored_meshes_are_seen_from_outside() {
        let mut seeded = Seeded(11);
        for mirrored in 0..8 {
            let factor = |axis: usize| if mirrored >> axis & 1 == 1 { -1.0 } else { 1.0 };
            let scale = Vector3::from_fn(|axis, _| factor(axis) * seeded.between(0.5, 2.0));
            let turn = UnitQuaternion::from_scaled_axis(seeded.unit() * 2.0);
            let origin = Isometry3::from_parts((seeded.unit() * 3.0).into(), turn);
            let geometry = Piece::Mesh { uri: "it.stl".into(), scale };
            let link = Link { name: "link".into(), collisions: vec![Collision { origin, geometry }] };
            let mesh = link_mesh(&link, |_| Ok::<_, String>(tetrahedron())).expect("a mesh");
            let (volume, expected) = (volume_m3(&mesh), scale.product().abs());
            assert!((volume - expected).abs() < 1e-12, "{scale}: {volume} {expected}");
            for (point, before) in mesh.points.iter().zip(&tetrahedron().points) {
                let expected = turn * before.component_mul(&scale) + origin.translation.vector;
                assert!((point - expected).norm() < 1e-13, "{scale}: {point} {expected}");
            }
        }
    }
}
