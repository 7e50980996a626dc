//! Bodies around the meshes of links that LoadRobot sends along.

use std::borrow::Cow;
use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use sha2::{Digest, Sha256};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::Status;

use super::app_state::AppState;
use super::blobs::Blobs;
use super::error::{self, Invalid};
use super::fits::request::format;
use super::limits::{MAX_FIT_POINTS, MAX_FIT_TRIANGLES};
use super::proto::fit_mesh::Content;
use super::proto::{FitMesh, LinkBody, LinkMesh, LoadRobotRequest};
use super::wire;
use crate::body::{BodyId, Shape};
use crate::jobs::{LinkFit, Mesh, fit_link, has_mesh, link_mesh, link_request, read_mesh};
use crate::robot::{Link, read_srdf, read_urdf};
use crate::scene::Geometry;

/// Links that are remembered.
const MAX_KNOWN: usize = 1000;

/// Fits of links: one robot after the other, each link once per content.
#[derive(Debug)]
pub(super) struct LinkFits {
    fitting: Arc<Semaphore>,
    /// What was made of a link, by the hash of all that it was made from.
    known: Arc<Mutex<HashMap<[u8; 32], BodyId>>>,
}

/// Sets its flag when the call is over, so that fits for nobody end.
struct StopOnDrop(Arc<AtomicBool>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

impl Default for LinkFits {
    fn default() -> Self {
        Self { fitting: Arc::new(Semaphore::new(1)), known: Arc::default() }
    }
}

impl LinkFits {
    /// Fits bodies to the meshes of a request, stores them, and names them in its `link_bodies`.
    pub(super) async fn resolve(&self, app: &AppState, request: &mut LoadRobotRequest) -> Result<(), Status> {
        let meshes = std::mem::take(&mut request.meshes);
        let how = request.max_gap_m.map_or_else(LinkFit::default, LinkFit::WithinGap);
        link_request("link", how).map_err(|error| Invalid::new(error.field, error.why))?;
        if meshes.is_empty() {
            return Ok(());
        }
        for (index, given) in request.link_bodies.iter().enumerate() {
            wire::body_id(&given.body_id, &format!("link_bodies[{index}].body_id"))?;
        }
        let Ok(turn) = self.fitting.clone().acquire_owned().await else { return Err(error::abandoned()) };
        let turn = Arc::new(turn);
        let (reader, urdf, srdf) = (app.clone(), request.urdf.clone(), request.srdf.clone());
        let given: Vec<String> = request.link_bodies.iter().map(|body| body.link.clone()).collect();
        let links = app.prove(move || links_with_meshes((&urdf, &srdf), &given, &meshes, reader.blobs())).await??;
        let stop = StopOnDrop(Arc::default());
        for (link, mesh) in links {
            let name = link.name.to_string();
            let id = self.body(app, (link, mesh), how, (&stop.0, &turn)).await?;
            request.link_bodies.push(LinkBody { link: name, body_id: id.to_string() });
        }
        Ok(())
    }

    /// The stored body of a link.
    async fn body(
        &self,
        app: &AppState,
        (link, mesh): (Link, Mesh),
        how: LinkFit,
        (stop, turn): (&Arc<AtomicBool>, &Arc<OwnedSemaphorePermit>),
    ) -> Result<BodyId, Status> {
        let key = content(&link, &mesh, how);
        let known = self.known.lock().unwrap_or_else(PoisonError::into_inner).get(&key).copied();
        if let Some(id) = known
            && app.catalogue().await?.geometry(&id).is_ok()
        {
            return Ok(id);
        }
        let (stop, name) = (stop.clone(), link.name.clone());
        let going_on =
            move || if stop.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let turn = turn.clone();
        let fit = move || {
            // Held until the end, also when the caller is gone.
            let _turn = turn;
            fit_link(&link, mesh, how, going_on)
        };
        let fitted = tokio::task::spawn_blocking(fit).await;
        let shape = fitted.map_err(|error| error::internal_panic(&error))?;
        let shape = shape.map_err(|error| Invalid::new("meshes", format!("of link \"{name}\": {error}")))?;
        let geometry: Geometry = match shape {
            Shape::Body(body) => (*body).into(),
            Shape::Compound(compound) => (*compound).into(),
        };
        let (stored, _) = app.change("meshes", move |catalogue| catalogue.create_body(geometry)).await?;
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if known.len() >= MAX_KNOWN {
            known.clear();
        }
        known.insert(key, *stored.id());
        Ok(*stored.id())
    }
}

/// The links that have meshes and no body, with their meshes in the frame of the link.
fn links_with_meshes(
    (urdf, srdf): (&str, &str),
    given: &[String],
    meshes: &[LinkMesh],
    blobs: &Blobs,
) -> Result<Vec<(Link, Mesh)>, Status> {
    let description = read_urdf(urdf).map_err(|error| Invalid::new("urdf", error))?;
    if !srdf.is_empty() {
        read_srdf(srdf, &description).map_err(|error| Invalid::new("srdf", error))?;
    }
    let mut read: Vec<Option<Arc<Mesh>>> = vec![None; meshes.len()];
    let mut places = HashMap::with_capacity(meshes.len());
    for (index, mesh) in meshes.iter().enumerate() {
        if places.insert(mesh.uri.as_str(), index).is_some() {
            return Err(Invalid::new(format!("meshes[{index}].uri"), "is sent twice; send each file once").into());
        }
    }
    let (mut links, mut size) = (Vec::new(), Size::default());
    for link in description.links.iter().filter(|link| has_mesh(link) && !given.iter().any(|name| **name == *link.name))
    {
        let mesh = link_mesh(link, |uri| {
            let Some(&index) = places.get(uri) else {
                let why = format!(
                    "holds no file for {uri} of link \"{}\"; send it, or a body for the link in link_bodies",
                    link.name
                );
                return Err(Status::from(Invalid::new("meshes", why)));
            };
            let mesh = match &read[index] {
                Some(mesh) => mesh.clone(),
                None => {
                    let field = format!("meshes[{index}].mesh");
                    let mesh = Arc::new(sent(meshes[index].mesh.as_ref(), uri, &field, blobs)?);
                    // What is kept of the file counts, and every use of it.
                    size.add(&mesh)?;
                    read[index] = Some(mesh.clone());
                    mesh
                }
            };
            size.add(&mesh)?;
            Ok(mesh)
        })?;
        links.push((link.clone(), mesh));
    }
    match read.iter().position(Option::is_none) {
        Some(index) => {
            let why = "is named by no link that needs a body; leave it out, or send it as the URDF names it";
            Err(Invalid::new(format!("meshes[{index}].uri"), why).into())
        }
        None => Ok(links),
    }
}

/// Points and triangles that are in memory.
#[derive(Default)]
struct Size {
    points: usize,
    triangles: usize,
}

impl Size {
    fn add(&mut self, mesh: &Mesh) -> Result<(), Invalid> {
        self.points += mesh.points.len();
        self.triangles += mesh.triangles.len();
        if self.points > MAX_FIT_POINTS || self.triangles > MAX_FIT_TRIANGLES {
            let why = format!(
                "have more than {MAX_FIT_POINTS} points or {MAX_FIT_TRIANGLES} triangles together, every use of a \
                 file counted; send coarser meshes, or bodies in link_bodies"
            );
            return Err(Invalid::new("meshes", why));
        }
        Ok(())
    }
}

/// Points and triangles of a file that was sent.
fn sent(mesh: Option<&FitMesh>, uri: &str, field: &str, blobs: &Blobs) -> Result<Mesh, Status> {
    let Some(FitMesh { format: number, content: Some(content) }) = mesh else {
        return Err(Invalid::new(field, "is missing; send the file, or the blob_id of an upload").into());
    };
    let ending = format(*number, &format!("{field}.format"))?;
    let blob;
    let file: Cow<'_, [u8]> = match content {
        Content::File(bytes) => bytes[..].into(),
        Content::BlobId(id) => {
            blob = blobs.get(id, &format!("{field}.blob_id"))?;
            blob[..].into()
        }
    };
    let reading = read_mesh(&file, ending, uri, 1.0).map_err(|error| Invalid::new(field, error))?;
    Ok(reading.mesh)
}

/// Hash of all that a body of a link is made from.
fn content(link: &Link, mesh: &Mesh, how: LinkFit) -> [u8; 32] {
    let mut hash = Sha256::new();
    // The name goes into the body, and what is no mesh becomes part of it.
    hash.update(format!("{link:?} {how:?}"));
    mesh.points.iter().flatten().for_each(|coordinate| hash.update(coordinate.to_le_bytes()));
    mesh.triangles.iter().flatten().for_each(|corner| hash.update((*corner as u64).to_le_bytes()));
    hash.finalize().into()
}
