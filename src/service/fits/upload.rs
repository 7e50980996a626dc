//! The stream of a CreateFit call: the header, then points and triangles, a mesh file in pieces, or
//! nothing.

use nalgebra::Vector3;
use tonic::{Status, Streaming};

use super::super::error::Invalid;
use super::super::limits::{MAX_FIT_POINTS, MAX_FIT_TRIANGLES, MAX_MESH_BYTES};
use super::super::proto::create_fit_request::Part;
use super::super::proto::{CreateFitRequest, FitHeader};
use super::request::request;
use crate::jobs;
use crate::store::{FitMode, FitRequest, NewJob};

/// Everything a client sent.
#[derive(Debug)]
pub(super) struct Upload {
    request_id: String,
    request: FitRequest,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// Points, metres, and corners of triangles.
    Points(Vec<Vector3<f64>>, Vec<[u32; 3]>),
    /// A file in a format, by its ending.
    Mesh(&'static str, Vec<u8>),
    /// The bodies are there.
    Group,
}

/// Reads the stream to its end, refusing what cannot be used as soon as it comes.
pub(super) async fn receive(mut stream: Streaming<CreateFitRequest>) -> Result<Upload, Status> {
    let missing = || Invalid::new("header", "is missing; send it in the first message");
    let first = stream.message().await?.and_then(|message| message.part);
    let Some(Part::Header(header)) = first else { return Err(missing().into()) };
    let mut upload = Upload::new(header)?;
    while let Some(message) = stream.message().await? {
        upload.add(message.part)?;
    }
    Ok(upload)
}

impl Upload {
    fn new(header: FitHeader) -> Result<Self, Invalid> {
        let (request_id, request, format) = request(header)?;
        let content = match format {
            _ if request.group().is_some() => Content::Group,
            Some(format) => Content::Mesh(format, Vec::new()),
            None => Content::Points(Vec::new(), Vec::new()),
        };
        Ok(Self { request_id, request, content })
    }

    fn add(&mut self, part: Option<Part>) -> Result<(), Invalid> {
        let field = match &part {
            Some(Part::Header(_)) => return Err(Invalid::new("header", "is sent twice; send it once, first")),
            Some(Part::Points(_)) => "points",
            Some(Part::Triangles(_)) => "triangles",
            Some(Part::Mesh(_)) => "mesh",
            None => return Err(Invalid::new("part", "is empty; send points, triangles or a piece of the mesh file")),
        };
        let why = match (part, &mut self.content) {
            (Some(Part::Points(chunk)), Content::Points(points, _)) => {
                return add_points(points, &chunk.coordinates, self.request.scale);
            }
            (Some(Part::Triangles(chunk)), Content::Points(_, triangles)) => {
                return add_triangles(triangles, &chunk.corners, self.request.uses_triangles());
            }
            (Some(Part::Mesh(bytes)), Content::Mesh(_, file)) => return add_bytes(file, &bytes),
            (_, Content::Group) => "not expected where the options name a group of stored bodies; send the header only",
            (_, Content::Mesh(..)) => "sent where the header says that a mesh file follows; send either",
            (_, Content::Points(..)) => "sent where the header names no mesh format; name it, or send points",
        };
        Err(Invalid::new(field, format!("{} {why}", if field == "mesh" { "is" } else { "are" })))
    }

    /// Reads the mesh, if it is one. Takes a while for large ones.
    pub(super) fn into_job(self) -> Result<NewJob, Invalid> {
        let Self { request_id, request, content } = self;
        let (field, points, triangles) = match content {
            Content::Points(points, triangles) => ("points", points, triangles),
            Content::Mesh(format, file) => {
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
                if triangles.len() > MAX_FIT_TRIANGLES {
                    return Err(Invalid::new("mesh", too_many()));
                }
                // Too large for any number of points that is accepted.
                let corner = |corner| u32::try_from(corner).unwrap_or(u32::MAX);
                ("mesh", mesh.points, triangles.into_iter().map(|corners| corners.map(corner)).collect())
            }
            Content::Group => return Ok(NewJob::new(request_id, request, &[], &[])),
        };
        // Copies to both sides give a volume to any number of points.
        let least = if request.mode.preparation().min_thickness_m.is_some() { 1 } else { 4 };
        if !(least..=MAX_FIT_POINTS).contains(&points.len()) {
            let why = format!("has {} points; this fit takes {least} to {MAX_FIT_POINTS}", points.len());
            return Err(Invalid::new(field, why));
        }
        let is_there = |corner: &u32| usize::try_from(*corner).is_ok_and(|corner| corner < points.len());
        if let Some(index) = triangles.iter().position(|corners| !corners.iter().all(is_there)) {
            let (corners, count): (&[u32; 3], _) = (&triangles[index], points.len());
            let why =
                format!("triangle {index} (counted from 0) has the corners {corners:?}, but there are {count} points");
            return Err(Invalid::new("triangles.corners", why + "; count points from 0, and send all of them"));
        }
        if matches!(request.mode, FitMode::Compound(_)) && triangles.is_empty() {
            let why = "parts are cut from a mesh, and no triangles are sent; send them, or choose another mode";
            return Err(Invalid::new(if field == "mesh" { "mesh" } else { "triangles" }, why));
        }
        Ok(NewJob::new(request_id, request, &points, &triangles))
    }
}

fn add_bytes(file: &mut Vec<u8>, bytes: &[u8]) -> Result<(), Invalid> {
    if file.len() + bytes.len() > MAX_MESH_BYTES {
        let why = format!("has more than {MAX_MESH_BYTES} bytes; make the mesh coarser, or send its points");
        return Err(Invalid::new("mesh", why));
    }
    file.extend_from_slice(bytes);
    Ok(())
}

fn add_points(points: &mut Vec<Vector3<f64>>, coordinates: &[f64], scale: f64) -> Result<(), Invalid> {
    let refused = |why: String| Err(Invalid::new("points.coordinates", why));
    let (chunk, rest) = coordinates.as_chunks::<3>();
    if !rest.is_empty() {
        return refused(format!("has {} numbers; send x, y and z of every point in one message", coordinates.len()));
    }
    if points.len() + chunk.len() > MAX_FIT_POINTS {
        return refused(format!(
            "has more than {MAX_FIT_POINTS} points; send fewer: those of the convex hull suffice for bodies"
        ));
    }
    for &point in chunk {
        let point = Vector3::from(point) * scale;
        if !point.iter().all(|value| value.is_finite()) {
            let why = format!("point {} (counted from 0) is not finite in metres; remove it", points.len());
            return refused(why);
        }
        points.push(point);
    }
    Ok(())
}

/// Keeps triangles only where they are of use.
fn add_triangles(triangles: &mut Vec<[u32; 3]>, corners: &[u32], of_use: bool) -> Result<(), Invalid> {
    let refused = |why: String| Err(Invalid::new("triangles.corners", why));
    let (chunk, rest) = corners.as_chunks::<3>();
    if !rest.is_empty() {
        return refused(format!("has {} numbers; send the three of every triangle in one message", corners.len()));
    }
    if triangles.len() + chunk.len() > MAX_FIT_TRIANGLES {
        return refused(too_many());
    }
    if of_use {
        triangles.extend_from_slice(chunk);
    }
    Ok(())
}

fn too_many() -> String {
    format!("has more than {MAX_FIT_TRIANGLES} triangles; make the mesh coarser")
}
