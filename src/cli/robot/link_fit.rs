//! Bodies of the links that have meshes.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::args::RobotArgs;
use crate::body::{Body, Shape, Solid};
use crate::cli::files::{read_shape, write_atomically};
use crate::cli::mesh::note;
use crate::cli::progress::progress_bar;
use crate::fit::{Mesh, ReadOptions, read_mesh};
use crate::jobs::{LinkFit, RequestError, exact_parts, fit_link, has_mesh, link_mesh, link_request};
use crate::robot::{Description, Link, MeshPaths};
use crate::scene::Geometry;

/// The body of a link that has meshes.
pub(super) struct FittedLink {
    pub(super) link: Arc<str>,
    /// In the frame of the link.
    pub(super) geometry: Geometry,
    pub(super) file: PathBuf,
    /// Whether it was there from an earlier run.
    pub(super) was_kept: bool,
    pub(super) degree: usize,
    pub(super) parts: usize,
}

/// Fits every link with meshes, in the order of the file.
pub(super) fn fit_links(args: &RobotArgs, description: &Description) -> Result<Vec<FittedLink>, Box<dyn Error>> {
    let paths = mesh_paths(args);
    let links: Vec<&Link> = description.links.iter().filter(|link| has_mesh(link)).collect();
    let bar = progress_bar("links");
    let mut fits = Vec::with_capacity(links.len());
    for (index, link) in links.iter().enumerate() {
        bar.set_message(format!("{} ({} of {})", link.name, index + 1, links.len()));
        let of_link = |error: Box<dyn Error>| format!("link \"{}\": {error}", link.name);
        let mesh = joined(link, &paths).map_err(of_link)?;
        fits.push(fit(args, link, mesh).map_err(of_link)?);
    }
    bar.finish_and_clear();
    Ok(fits)
}

fn mesh_paths(args: &RobotArgs) -> MeshPaths {
    let folder = args.urdf.parent().filter(|folder| !folder.as_os_str().is_empty());
    let mut paths = MeshPaths::new(folder.unwrap_or(Path::new(".")));
    for (name, folder) in &args.packages {
        paths = paths.with_package(name, folder);
    }
    for folder in &args.search {
        paths = paths.with_search(folder);
    }
    paths
}

/// All meshes of a link in its frame, metres.
fn joined(link: &Link, paths: &MeshPaths) -> Result<Mesh, Box<dyn Error>> {
    link_mesh(link, |uri| {
        let path = paths.resolve(uri)?;
        let reading = read_mesh(&path, &ReadOptions::default())?;
        note(&path, &reading);
        Ok(Arc::new(reading.mesh))
    })
}

/// Fits a link, or reads the file that an earlier run has written for the same meshes and options.
fn fit(args: &RobotArgs, link: &Link, mesh: Mesh) -> Result<FittedLink, Box<dyn Error>> {
    let how = args.max_gap.map(LinkFit::WithinGap).or(args.degree.map(LinkFit::Degree)).unwrap_or_default();
    let named =
        |error: RequestError| format!("--{}: {}", error.field.trim_end_matches("_m").replace('_', "-"), error.why);
    link_request(&link.name, how).map_err(named)?;
    let exact = exact_parts(link)?;
    let file = args.out.join(format!("{}-{}.json", file_name(&link.name), content(how, &mesh, &exact)));
    let was_kept = file.exists();
    let shape = if was_kept {
        read_shape(&file)?
    } else {
        let shape = fit_link(link, mesh, how, || ControlFlow::Continue(()))?;
        let text = match &shape {
            Shape::Body(body) => body.to_json(),
            Shape::Compound(compound) => compound.to_json(),
        };
        write_atomically(&file, &text)?;
        shape
    };
    let degree = shape.parts().iter().map(Body::degree).max().unwrap_or(0);
    let parts = shape.parts().len();
    let geometry = match shape {
        Shape::Body(body) => (*body).into(),
        Shape::Compound(compound) => (*compound).into(),
    };
    Ok(FittedLink { link: link.name.clone(), geometry, file, was_kept, degree, parts })
}

/// A name of a link that is usable as one of a file.
fn file_name(link: &str) -> String {
    link.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

/// Twelve digits of the hash of all that a body is made from.
fn content(how: LinkFit, mesh: &Mesh, exact: &[Body]) -> String {
    let mut hash = Sha256::new();
    hash.update(format!("{how:?} "));
    mesh.points.iter().flatten().for_each(|coordinate| hash.update(coordinate.to_le_bytes()));
    mesh.triangles.iter().flatten().for_each(|corner| hash.update((*corner as u64).to_le_bytes()));
    exact.iter().for_each(|body| hash.update(body.id().to_string()));
    hash.finalize().iter().take(6).map(|byte| format!("{byte:02x}")).collect()
}
