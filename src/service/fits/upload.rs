//! The stream of a CreateFit call: the header, then points or a mesh file in pieces.

use nalgebra::Vector3;
use tonic::{Status, Streaming};

use super::super::error::Invalid;
use super::super::limits::{MAX_FIT_POINTS, MAX_MESH_BYTES};
use super::super::proto::create_fit_request::Part;
use super::super::proto::{CreateFitRequest, FitHeader};
use super::wire;
use crate::jobs;
use crate::store::{FitOrder, NewJob};

/// Everything a client sent.
#[derive(Debug)]
pub(super) struct Upload {
    request_id: String,
    order: FitOrder,
    content: Content,
}

#[derive(Debug)]
enum Content {
    /// Metres.
    Points(Vec<Vector3<f64>>),
    /// A file in a format, by its ending.
    Mesh(&'static str, Vec<u8>),
}

/// Reads the stream to its end, refusing what can not be used as soon as it comes.
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
        let (request_id, order, format) = wire::order(header)?;
        let content = format.map_or(Content::Points(Vec::new()), |format| Content::Mesh(format, Vec::new()));
        Ok(Self { request_id, order, content })
    }

    fn add(&mut self, part: Option<Part>) -> Result<(), Invalid> {
        match (part, &mut self.content) {
            (Some(Part::Points(chunk)), Content::Points(points)) => {
                add_points(points, &chunk.coordinates, self.order.scale)
            }
            (Some(Part::Mesh(bytes)), Content::Mesh(_, file)) => {
                if file.len() + bytes.len() > MAX_MESH_BYTES {
                    let why = format!("has more than {MAX_MESH_BYTES} bytes; send the vertices of its hull as points");
                    return Err(Invalid::new("mesh", why));
                }
                file.extend_from_slice(&bytes);
                Ok(())
            }
            (Some(Part::Points(_)), _) => {
                Err(Invalid::new("points", "are sent where the header says that a mesh file follows; send either"))
            }
            (Some(Part::Mesh(_)), _) => {
                Err(Invalid::new("mesh", "is sent where the header names no mesh format; name it, or send points"))
            }
            (Some(Part::Header(_)), _) => Err(Invalid::new("header", "is sent twice; send it once, first")),
            (None, _) => Err(Invalid::new("part", "is empty; send points or a piece of the mesh file")),
        }
    }

    /// Reads the mesh, if it is one. Takes a while for large ones.
    pub(super) fn into_job(self) -> Result<NewJob, Invalid> {
        let Self { request_id, order, content } = self;
        let (field, points) = match content {
            Content::Points(points) => ("points", points),
            Content::Mesh(format, file) => {
                let points = jobs::read_mesh(&file, format, &order.input, order.scale);
                ("mesh", points.map_err(|error| Invalid::new("mesh", error))?)
            }
        };
        if !(4..=MAX_FIT_POINTS).contains(&points.len()) {
            let why = format!("has {} points; a fit takes 4 to {MAX_FIT_POINTS}", points.len());
            return Err(Invalid::new(field, why));
        }
        Ok(NewJob::new(request_id, order, &points))
    }
}

fn add_points(points: &mut Vec<Vector3<f64>>, coordinates: &[f64], scale: f64) -> Result<(), Invalid> {
    let refused = |why: String| Err(Invalid::new("points.coordinates", why));
    let (chunk, rest) = coordinates.as_chunks::<3>();
    if !rest.is_empty() {
        return refused(format!("has {} numbers; send x, y and z of every point in one message", coordinates.len()));
    }
    if points.len() + chunk.len() > MAX_FIT_POINTS {
        return refused(format!("has more than {MAX_FIT_POINTS} points; send fewer, those of the convex hull suffice"));
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
