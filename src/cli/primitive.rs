//! `sublevel primitive`.

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::Vector3;

use super::numbers::Triple;
use super::write_atomically;
use crate::body::Body;
use crate::measure::{Capsule, HalfSpace};
use crate::scene::{Geometry, NamedCapsule, NamedHalfSpace};

/// Write an exact body from its sizes
///
/// The file contains the shape itself, not a fit of it: contact with it is certain. `sublevel push`
/// stores it in a server, `sublevel measure` measures with it. The shape is centred at the origin
/// of its frame; lengths are metres.
///
/// Examples:
///   sublevel primitive box --half-extents 0.5,0.3,0.02 --out table.json
///   sublevel primitive cylinder --radius 0.05 --half-height 0.1 --out can.json
///   sublevel primitive half-space --normal 0,0,1 --offset 0 --out floor.json
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct PrimitiveArgs {
    #[command(subcommand)]
    shape: Shape,
}

#[derive(Debug, clap::Subcommand)]
enum Shape {
    /// A box with its edges along the axes
    Box {
        /// Half the lengths of its edges, metres, each above 0
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
        half_extents: Triple,
        #[command(flatten)]
        file: FileArgs,
    },
    /// A ball
    Ball {
        /// Its radius, metres, above 0
        #[arg(long, value_name = "R", allow_hyphen_values = true)]
        radius: f64,
        #[command(flatten)]
        file: FileArgs,
    },
    /// An ellipsoid with its axes along x, y and z
    Ellipsoid {
        /// Its half-axes, metres, each above 0
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
        half_axes: Triple,
        #[command(flatten)]
        file: FileArgs,
    },
    /// A cylinder about z
    Cylinder {
        /// Its radius, metres, above 0
        #[arg(long, value_name = "R", allow_hyphen_values = true)]
        radius: f64,
        /// Half its height, metres, above 0
        #[arg(long, value_name = "H", allow_hyphen_values = true)]
        half_height: f64,
        #[command(flatten)]
        file: FileArgs,
    },
    /// A capsule about z: all points within a radius of a segment
    Capsule {
        /// Its radius, metres; 0 for a segment
        #[arg(long, value_name = "R", allow_hyphen_values = true)]
        radius: f64,
        /// Half the length of its segment, metres; 0 for a ball
        #[arg(long, value_name = "H", allow_hyphen_values = true)]
        half_height: f64,
        #[command(flatten)]
        file: FileArgs,
    },
    /// Everything below a plane, {x : normal·x <= offset}: a floor or a wall
    HalfSpace {
        /// Its outward normal, of any length above 0
        #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
        normal: Triple,
        /// How far the plane is from the origin along the normal, metres
        #[arg(long, value_name = "D", allow_hyphen_values = true)]
        offset: f64,
        #[command(flatten)]
        file: FileArgs,
    },
}

#[derive(Debug, clap::Args)]
struct FileArgs {
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Name of the body; the kind of shape if not given
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
}

/// Writes the file.
///
/// # Errors
/// A size that is not usable, named by its argument, and files that cannot be written.
pub(super) fn run(args: &PrimitiveArgs) -> Result<(), Box<dyn Error>> {
    let name = |file: &FileArgs, kind: &str| file.name.clone().unwrap_or_else(|| kind.to_owned());
    let (file, argument, body) = match &args.shape {
        Shape::Box { half_extents, file } => (file, "--half-extents", Body::cuboid(&name(file, "box"), half_extents.0)),
        Shape::Ball { radius, file } => (file, "--radius", Body::ball(&name(file, "ball"), Vector3::zeros(), *radius)),
        Shape::Ellipsoid { half_axes, file } => {
            (file, "--half-axes", Body::ellipsoid(&name(file, "ellipsoid"), Vector3::zeros(), half_axes.0))
        }
        Shape::Cylinder { radius, half_height, file } => {
            let argument = if *radius > 0.0 { "--half-height" } else { "--radius" };
            (file, argument, Body::cylinder(&name(file, "cylinder"), *radius, *half_height))
        }
        Shape::Capsule { radius, half_height, file } => {
            let capsule = Capsule::new(*radius, *half_height);
            let capsule = capsule.map_err(|error| format!("--{}: {error}", error.size.replace(' ', "-")))?;
            let named = NamedCapsule::new(&name(file, "capsule"), capsule)?;
            write_atomically(&file.out, &Geometry::from(named).to_json())?;
            return Ok(());
        }
        Shape::HalfSpace { normal, offset, file } => {
            let length = normal.0.norm();
            let half_space = HalfSpace::new(normal.0 / length, *offset);
            let half_space = half_space.map_err(|error| format!("--normal or --offset: {error}"))?;
            let named = NamedHalfSpace::new(&name(file, "half-space"), half_space)?;
            write_atomically(&file.out, &Geometry::HalfSpace(Arc::new(named)).to_json())?;
            return Ok(());
        }
    };
    let body = body.map_err(|error| format!("{argument}: {error}"))?.with_gap(0.0);
    write_atomically(&file.out, &body.to_json())?;
    Ok(())
}
