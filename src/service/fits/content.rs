//! What a CreateFit call is about: points with triangles, a mesh file, or a group.

use std::borrow::Cow;

use nalgebra::Vector3;
use tonic::Status;

use super::request::request;
use crate::jobs;
use crate::robot::counted;
use crate::service::blobs::Blobs;
use crate::service::error::{Invalid, at_most};
use crate::service::limits::{MAX_FIT_POINTS, MAX_FIT_TRIANGLES};
use crate::service::packed;
use crate::service::proto::create_fit_request::Source;
use crate::service::proto::fit_mesh::Content;
use crate::service::proto::fit_points::{Coordinates, Corners};
use crate::service::proto::{CreateFitRequest, FitMesh, FitPoints};
use crate::store::{FitMode, FitRequest, NewJob};

/// Reads the request and its points, which takes a while for large meshes.
pub(super) fn job(mut message: CreateFitRequest, blobs: &Blobs) -> Result<NewJob, Status> {
    let source = message.source.take();
    let (request_id, request) = request(message)?;
    let (field, points, triangles) = match (source, request.group()) {
        (None, Some(_)) => return Ok(NewJob::fit(request_id, request, &[], &[])),
        (Some(_), Some(_)) => {
            let why = "is sent where the options name a group of stored bodies; leave out one of the two";
            return Err(Invalid::new("source", why).into());
        }
        (None, None) => return Err(Invalid::new("source", "is missing; send points or a mesh").into()),
        (Some(Source::Points(points)), None) => {
            let (points, triangles) = sent_points(&points, &request, blobs)?;
            ("points", points, triangles)
        }
        (Some(Source::Mesh(mesh)), None) => {
            let (points, triangles) = sent_mesh(&mesh, &request, blobs)?;
            ("mesh", points, triangles)
        }
    };
    // Copies to both sides give a volume to any number of points.
    let least = if request.mode.preparation().min_thickness_m.is_some() { 1 } else { 4 };
    if !(least..=MAX_FIT_POINTS).contains(&points.len()) {
        let found = counted(points.len(), "point", "points");
        let why = format!("has {found}; this fit takes {least} to {MAX_FIT_POINTS}");
        return Err(Invalid::new(field, why).into());
    }
    let is_there = |corner: &u32| usize::try_from(*corner).is_ok_and(|corner| corner < points.len());
    if let Some(index) = triangles.iter().position(|corners| !corners.iter().all(is_there)) {
        let (corners, count): (&[u32; 3], _) = (&triangles[index], points.len());
        let why =
            format!("triangle {index} (counted from 0) has the corners {corners:?}, but there are {count} points");
        return Err(Invalid::new("points.triangles", why + "; count points from 0, and send all of them").into());
    }
    if matches!(request.mode, FitMode::Compound(_)) && triangles.is_empty() {
        let why = "parts are cut from a mesh, and no triangles are sent; send them, or choose another mode";
        let field = if field == "mesh" { "mesh" } else { "points.triangles" };
        return Err(Invalid::new(field, why).into());
    }
    Ok(NewJob::fit(request_id, request, &points, &triangles))
}

type Mesh = (Vec<Vector3<f64>>, Vec<[u32; 3]>);

fn sent_points(sent: &FitPoints, request: &FitRequest, blobs: &Blobs) -> Result<Mesh, Status> {
    let blob;
    let (field, bytes) = match &sent.coordinates {
        None => return Err(Invalid::new("points.points", "is missing; send the points").into()),
        Some(Coordinates::Points(bytes)) => ("points.points", &bytes[..]),
        Some(Coordinates::PointsBlobId(id)) => {
            blob = blobs.get(id, "points.points_blob_id")?;
            ("points.points_blob_id", &blob[..])
        }
    };
    let rows = packed::rows::<3>(bytes, field)?;
    at_most(field, rows.len(), ("MAX_FIT_POINTS", MAX_FIT_POINTS))?;
    let points: Vec<_> = rows.into_iter().map(|row| Vector3::from(row) * request.scale).collect();
    if let Some(index) = points.iter().position(|point| !point.iter().all(|value| value.is_finite())) {
        let why = format!("point {index} (counted from 0) is not finite in metres; remove it");
        return Err(Invalid::new(field, why).into());
    }
    let blob;
    let (field, bytes) = match &sent.corners {
        None => return Ok((points, Vec::new())),
        Some(Corners::Triangles(bytes)) => ("points.triangles", &bytes[..]),
        Some(Corners::TrianglesBlobId(id)) => {
            blob = blobs.get(id, "points.triangles_blob_id")?;
            ("points.triangles_blob_id", &blob[..])
        }
    };
    let triangles = packed::indices::<3>(bytes, field)?;
    at_most(field, triangles.len(), ("MAX_FIT_TRIANGLES", MAX_FIT_TRIANGLES))?;
    // Triangles are kept only where they are of use.
    Ok((points, if request.uses_triangles() { triangles } else { Vec::new() }))
}

fn sent_mesh(sent: &FitMesh, request: &FitRequest, blobs: &Blobs) -> Result<Mesh, Status> {
    let format = super::request::format(sent.format, "mesh.format")?;
    let blob;
    let file: Cow<'_, [u8]> = match &sent.content {
        None => return Err(Invalid::new("mesh.file", "is missing; send the file, or the blob_id of an upload").into()),
        Some(Content::File(bytes)) => bytes[..].into(),
        Some(Content::BlobId(id)) => {
            blob = blobs.get(id, "mesh.blob_id")?;
            blob[..].into()
        }
    };
    let read = jobs::read_mesh(&file, format, &request.input, request.scale);
    let read = read.map_err(|error| Invalid::new("mesh", error))?;
    // What unused vertices cost takes a hull, which a log is not worth.
    let unused = read.remarks.unused.as_ref().map_or(0, |unused| unused.points.len());
    if unused > 0 || read.remarks.crossing_faces > 0 {
        let crossing = read.remarks.crossing_faces;
        tracing::warn!(name = request.name, input = request.input, unused, crossing, "mesh of a fit");
    }
    let mesh = read.mesh;
    let triangles = if request.uses_triangles() { mesh.triangles } else { Vec::new() };
    at_most("mesh", triangles.len(), ("MAX_FIT_TRIANGLES", MAX_FIT_TRIANGLES))?;
    // Too large for any number of points that is accepted.
    let corner = |corner| u32::try_from(corner).unwrap_or(u32::MAX);
    Ok((mesh.points, triangles.into_iter().map(|corners| corners.map(corner)).collect()))
}
