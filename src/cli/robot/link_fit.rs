//! Bodies of the links that have meshes.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use nalgebra::{Point3, Vector3};
use sha2::{Digest, Sha256};

use super::args::RobotArgs;
use crate::body::{Body, Compound, Shape, Solid};
use crate::cli::files::{read_shape, write_atomically};
use crate::cli::fit::request::checked;
use crate::cli::mesh::note;
use crate::cli::progress::progress_bar;
use crate::fit::{Mesh, ReadOptions, read_mesh};
use crate::jobs::{Shapes, fit_mesh};
use crate::robot::{Collision, Description, Geometry as Piece, Link, MeshPaths};
use crate::scene::{Geometry, primitive_bodies};
use crate::store::{FitBody, FitMode, FitPolynomial, FitPreparation, FitRequest, FitWithinGap};

/// The body of a link that has meshes.
pub(super) struct LinkFit {
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
pub(super) fn fit_links(args: &RobotArgs, description: &Description) -> Result<Vec<LinkFit>, Box<dyn Error>> {
    let paths = mesh_paths(args);
    let has_mesh = |link: &&Link| link.collisions.iter().any(|piece| matches!(piece.geometry, Piece::Mesh { .. }));
    let links: Vec<&Link> = description.links.iter().filter(has_mesh).collect();
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
    let mut joined = Mesh { points: Vec::new(), triangles: Vec::new() };
    for Collision { origin, geometry } in &link.collisions {
        let Piece::Mesh { uri, scale } = geometry else { continue };
        let path = paths.resolve(uri)?;
        let reading = read_mesh(&path, &ReadOptions::default())?;
        note(&path, &reading);
        let first = joined.points.len();
        let placed = |point: &Vector3<f64>| (origin * Point3::from(point.component_mul(scale))).coords;
        joined.points.extend(reading.mesh.points.iter().map(placed));
        // A mirrored triangle is seen from behind.
        let is_mirrored = scale.iter().filter(|factor| **factor < 0.0).count() % 2 == 1;
        joined.triangles.extend(reading.mesh.triangles.iter().map(|&[a, b, c]| {
            let [b, c] = if is_mirrored { [c, b] } else { [b, c] };
            [a, b, c].map(|corner| corner + first)
        }));
    }
    Ok(joined)
}

/// What is asked for of a link.
fn request(args: &RobotArgs, link: &Link) -> Result<FitRequest, String> {
    let (polynomial, preparation) = (FitPolynomial::default(), FitPreparation::default());
    let mode: FitMode = match args.degree {
        Some(degree) => {
            let polynomial = FitPolynomial { degree: Some(degree), ..polynomial };
            FitBody { polynomial, slabs: 0, preparation }.into()
        }
        None => FitWithinGap { max_gap_m: args.max_gap, polynomial, preparation }.into(),
    };
    checked(FitRequest::new(&*link.name, mode))
}

/// Fits a link, or reads the file that an earlier run has written for the same meshes and options.
fn fit(args: &RobotArgs, link: &Link, mesh: Mesh) -> Result<LinkFit, Box<dyn Error>> {
    let request = request(args, link)?;
    let exact = exact_parts(link)?;
    let file = args.out.join(format!("{}-{}.json", file_name(&link.name), content(args, &mesh, &exact)));
    let was_kept = file.exists();
    let shape = if was_kept {
        read_shape(&file)?
    } else {
        let made = fit_mesh(&request, mesh, |_, _| ControlFlow::Continue(()))?;
        let shape = union(link, made.shapes, exact)?;
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
    Ok(LinkFit { link: link.name.clone(), geometry, file, was_kept, degree, parts })
}

/// Bodies of what is no mesh of a link, exactly.
fn exact_parts(link: &Link) -> Result<Vec<Body>, Box<dyn Error>> {
    let primitives = link.collisions.iter().filter(|piece| !matches!(piece.geometry, Piece::Mesh { .. }));
    let mut parts = Vec::new();
    for piece in primitives {
        parts.extend(primitive_bodies(&link.name, piece)?);
    }
    Ok(parts)
}

/// What was fitted, with the exact parts of the link.
fn union(link: &Link, shapes: Shapes, exact: Vec<Body>) -> Result<Shape, Box<dyn Error>> {
    let mut parts = match shapes {
        Shapes::Compound(compound) if exact.is_empty() => return Ok(Shape::Compound(compound)),
        Shapes::Compound(compound) => compound.parts().to_vec(),
        Shapes::Bodies(bodies) => bodies,
        Shapes::SosBody(_) => return Err("links become convex bodies; are the options the same?".into()),
    };
    parts.extend(exact);
    Ok(match parts.len() {
        1 => Shape::Body(Box::new(parts.remove(0))),
        _ => Shape::Compound(Box::new(Compound::new(&link.name, parts)?)),
    })
}

/// A name of a link that is usable as one of a file.
fn file_name(link: &str) -> String {
    link.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

/// Twelve digits of the hash of all that a body is made from.
fn content(args: &RobotArgs, mesh: &Mesh, exact: &[Body]) -> String {
    let mut hash = Sha256::new();
    hash.update(format!("{:?} {:?} ", args.degree, args.max_gap));
    mesh.points.iter().flatten().for_each(|coordinate| hash.update(coordinate.to_le_bytes()));
    mesh.triangles.iter().flatten().for_each(|corner| hash.update((*corner as u64).to_le_bytes()));
    exact.iter().for_each(|body| hash.update(body.id().to_string()));
    hash.finalize().iter().take(6).map(|byte| format!("{byte:02x}")).collect()
}
