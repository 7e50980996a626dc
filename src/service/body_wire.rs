//! Bodies in messages.

use std::ops::RangeInclusive;
use std::sync::Arc;

use nalgebra::Vector3;
use tonic::Status;

use crate::body::{Body, BodyError, BodyId, Shape};
use crate::measure::{Capsule, HalfSpace, HalfSpaceError};
use crate::scene::{Geometry, Ladder, LadderError, NamedCapsule, NamedHalfSpace};
use crate::store::CatalogueError;

use super::blobs::Blobs;
use super::error::{self, Invalid};
use super::proto::create_body_request::Source;
use super::proto::{self, BodyKind};
use super::wire;

/// The body that a request is about; `stored` looks up the rungs of a ladder.
pub(super) fn geometry(
    request: &proto::CreateBodyRequest,
    blobs: &Blobs,
    stored: impl Fn(&BodyId) -> Result<Geometry, CatalogueError>,
) -> Result<Geometry, Status> {
    let Some(source) = &request.source else {
        return Err(Invalid::new("source", "is missing; send a file, a blob_id, or the sizes of a primitive").into());
    };
    let named = |kind: &str| if request.name.is_empty() { kind.to_owned() } else { request.name.clone() };
    let exact = |body: Result<Body, BodyError>, field: &str| -> Result<Geometry, Status> {
        let field = if matches!(body, Err(BodyError::Name(_))) { "name" } else { field };
        let body = body.map_err(|error| Invalid::new(field, error))?;
        Ok(body.with_gap(0.0).into())
    };
    match source {
        Source::File(file) => read(file, "file"),
        Source::BlobId(id) => read(&blobs.get(id, "blob_id")?, "blob_id"),
        Source::Ball(size) => {
            let field = "ball.radius_m";
            check_size(size.radius_m, field)?;
            exact(Body::ball(&named("ball"), Vector3::zeros(), size.radius_m), field)
        }
        Source::Ellipsoid(size) => {
            let field = "ellipsoid.half_axes_m";
            let half_axes = sizes(size.half_axes_m.as_ref(), field)?;
            exact(Body::ellipsoid(&named("ellipsoid"), Vector3::zeros(), half_axes), field)
        }
        Source::Box(size) => {
            let field = "box.half_extents_m";
            let half_extents = sizes(size.half_extents_m.as_ref(), field)?;
            exact(Body::cuboid(&named("box"), half_extents), field)
        }
        Source::Cylinder(size) => {
            check_size(size.radius_m, "cylinder.radius_m")?;
            check_size(size.half_height_m, "cylinder.half_height_m")?;
            exact(Body::cylinder(&named("cylinder"), size.radius_m, size.half_height_m), "cylinder")
        }
        Source::Capsule(size) => {
            let capsule = Capsule::new(size.radius_m, size.half_height_m);
            let capsule = capsule.map_err(|error| {
                let field = if error.size == "radius" { "capsule.radius_m" } else { "capsule.half_height_m" };
                Invalid::new(field, error)
            })?;
            let named = NamedCapsule::new(&named("capsule"), capsule).map_err(|error| Invalid::new("name", error))?;
            Ok(named.into())
        }
        Source::HalfSpace(size) => {
            let normal = vector(size.normal.as_ref(), "half_space.normal")?;
            let half_space = HalfSpace::new(normal, size.offset_m);
            let half_space = half_space.map_err(|error| {
                let is_offset = error == HalfSpaceError::NotFinite("offset");
                Invalid::new(if is_offset { "half_space.offset_m" } else { "half_space.normal" }, error)
            })?;
            let named = NamedHalfSpace::new(&named("half-space"), half_space);
            let half_space = named.map_err(|error| Invalid::new("name", error))?;
            Ok(Geometry::HalfSpace(Arc::new(half_space)))
        }
        Source::Ladder(rungs) => {
            let rung = |(index, id): (usize, &String)| {
                let field = format!("ladder.body_ids[{index}]");
                let id = wire::body_id(id, &field)?;
                match stored(&id).map_err(|error| error::catalogue(&error, &field))? {
                    Geometry::Solid(shape) => Ok(shape),
                    _ => Err(Invalid::new(field, "is no single body; a ladder is made of bodies").into()),
                }
            };
            let rungs: Vec<Arc<Shape>> = rungs.body_ids.iter().enumerate().map(rung).collect::<Result<_, Status>>()?;
            let ladder = Ladder::new(&named("ladder"), rungs);
            Ok(Geometry::Ladder(Arc::new(ladder.map_err(|error| Invalid::new(ladder_field(&error), error))?)))
        }
    }
}

fn read(file: &[u8], field: &str) -> Result<Geometry, Status> {
    let text = std::str::from_utf8(file).map_err(|error| Invalid::new(field, format!("is no UTF-8 text: {error}")))?;
    Geometry::from_json(text).map_err(|error| Invalid::new(field, error).into())
}

/// Lengths between which sizes of bodies are, metres: what a normalization may have.
const SIZES_M: RangeInclusive<f64> = 1e-30..=1e30;

/// Refuses a size that no body has. Whether several make a body together shows when it is proven.
fn check_size(size: f64, field: &str) -> Result<(), Invalid> {
    // A NaN is in no range.
    if SIZES_M.contains(&size) {
        return Ok(());
    }
    Err(Invalid::new(field, format!("is {size:?} m; send a length between 1e-30 and 1e30 m")))
}

/// Three sizes.
fn sizes(sizes: Option<&proto::Vector3>, field: &str) -> Result<Vector3<f64>, Invalid> {
    let sizes = vector(sizes, field)?;
    for (axis, size) in ["x", "y", "z"].into_iter().zip(sizes.iter()) {
        check_size(*size, &format!("{field}.{axis}"))?;
    }
    Ok(sizes)
}

fn vector(vector: Option<&proto::Vector3>, field: &str) -> Result<Vector3<f64>, Invalid> {
    let vector = vector.ok_or_else(|| Invalid::new(field, "is missing; send x, y and z"))?;
    Ok(Vector3::new(vector.x, vector.y, vector.z))
}

/// Which field makes a ladder unusable.
fn ladder_field(error: &LadderError) -> String {
    match error {
        LadderError::Name(_) => "name".to_owned(),
        LadderError::Count(_) => "ladder.body_ids".to_owned(),
        LadderError::Compound(index) | LadderError::Points(index) | LadderError::Order(index) => {
            format!("ladder.body_ids[{index}]")
        }
    }
}

/// What a body is.
pub(super) fn kind(geometry: &Geometry) -> BodyKind {
    match geometry {
        Geometry::Solid(shape) => match **shape {
            Shape::Body(_) => BodyKind::Body,
            Shape::Compound(_) => BodyKind::Compound,
        },
        Geometry::Ladder(_) => BodyKind::Ladder,
        Geometry::SosBody(_) => BodyKind::SosBody,
        Geometry::Capsule(_) => BodyKind::Capsule,
        Geometry::HalfSpace(_) => BodyKind::HalfSpace,
    }
}

pub(super) fn summary(geometry: &Geometry) -> proto::BodySummary {
    let parts: &[Body] = match geometry {
        Geometry::Solid(shape) => crate::body::Solid::parts(&**shape),
        Geometry::Ladder(ladder) => crate::body::Solid::parts(&**ladder.finest()),
        Geometry::SosBody(_) | Geometry::Capsule(_) | Geometry::HalfSpace(_) => &[],
    };
    let single = match parts {
        [body] => Some(body),
        _ => None,
    };
    let volume_m3 = match geometry {
        Geometry::SosBody(body) => Some(body.volume().volume_m3),
        Geometry::Capsule(capsule) => Some(capsule.volume_m3()),
        _ => single.map(|body| body.volume().volume_m3),
    };
    let rungs = match geometry {
        Geometry::Ladder(ladder) => ladder.rungs(),
        _ => &[],
    };
    let constraints: usize = parts.iter().map(|part| part.constraints().len()).sum();
    proto::BodySummary {
        id: geometry.id().to_string(),
        name: geometry.name().to_owned(),
        kind: kind(geometry).into(),
        degree: wire::count(geometry.degree()),
        constraint_count: wire::count(constraints.max(1)),
        part_count: wire::count(if rungs.is_empty() { parts.len().max(1) } else { rungs.len() }),
        volume_m3,
        min_value: single.map(Body::min_value),
        bounding_box: geometry.bounding_box().map(|bounds| proto::BoundingBox {
            min_m: Some(wire::vector(&bounds.min)),
            max_m: Some(wire::vector(&bounds.max)),
        }),
        gap_m: geometry.gap_m(),
        rung_ids: rungs.iter().map(|rung| rung.id().to_string()).collect(),
    }
}
