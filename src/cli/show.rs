//! `sublevel show`.

use super::{read, read_body, sos_body, write_atomically};
use crate::body::{Body, SosBody, Sphere};
use crate::chart::{Ink, Outline, Panel, Silhouettes, View, boundary_points, outline};
use serde_json::json;
use std::error::Error;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;

/// Boundary points that a silhouette is made of.
const SILHOUETTE_POINTS: usize = 6000;

/// Describe a body, export its surface, draw its silhouettes
///
/// The file is re-proven first, as by 'verify'. Lengths are metres in the body frame. Of an sos-body, which need not be convex, only
/// the description is printed.
///
/// Example: sublevel show bodies/mug-d6.json --mesh mug.obj --svg mug.svg
#[derive(Debug, clap::Args)]
pub(super) struct ShowArgs {
    /// Body file
    file: PathBuf,
    /// Print one JSON object instead of lines
    #[arg(long)]
    json: bool,
    /// Write the surface as a triangle mesh, inscribed in the body up to rounding
    #[arg(long, value_name = "OUT.obj")]
    mesh: Option<PathBuf>,
    /// Write the silhouettes seen along the three axes
    #[arg(long, value_name = "OUT.svg")]
    svg: Option<PathBuf>,
}

/// Describes and exports.
pub(super) fn run(args: &ShowArgs) -> Result<(), Box<dyn Error>> {
    if SosBody::is_file(&read(&args.file)?) {
        if args.mesh.is_some() || args.svg.is_some() {
            return Err(format!("{}: an sos-body is not drawn; leave out --mesh and --svg", args.file.display()).into());
        }
        return sos_body::show(&args.file, args.json);
    }
    let body = read_body(&args.file)?;
    if let Some(path) = &args.mesh {
        write_atomically(path, &mesh(&body))?;
    }
    if let Some(path) = &args.svg {
        write_atomically(path, &silhouettes(&body))?;
    }
    let mut out = io::stdout().lock();
    if args.json {
        writeln!(out, "{:#}", summary(&body))?;
    } else {
        describe(&mut out, &body)?;
    }
    Ok(())
}

fn summary(body: &Body) -> serde_json::Value {
    let array = |v: &nalgebra::Vector3<f64>| json!([v.x, v.y, v.z]);
    let (ball, bounds) = (body.circumscribed(), body.bounding_box());
    json!({
        "id": body.id().to_string(),
        "name": body.name(),
        "kind": "body",
        "degree": body.degree(),
        "constraints": body.constraints().len(),
        "min_value": body.min_value(),
        "interior_point_m": array(body.interior_point()),
        "in_radius_m": body.in_radius(),
        "circumscribed_ball": { "center_m": array(&ball.center), "radius_m": ball.radius },
        "bounding_box": { "min_m": array(&bounds.min), "max_m": array(&bounds.max) },
        "volume_m3": body.volume().volume_m3,
        "volume_error_m3": body.volume().error_m3,
        "gap_m": body.gap_m(),
        "contained_points": body.points(),
        "contained_sets": body.sets().iter().map(|set| json!({ "id": set.id.to_string(), "name": set.name })).collect::<Vec<_>>(),
        "provenance": body.provenance(),
    })
}

fn describe(out: &mut impl Write, body: &Body) -> io::Result<()> {
    // Digits as small bodies need them.
    let places = (7 - body.circumscribed().radius.log10().ceil() as i32).clamp(3, 15) as usize;
    let length = |x: f64| format!("{x:.places$}");
    let list = |v: &nalgebra::Vector3<f64>| format!("({}, {}, {})", length(v.x), length(v.y), length(v.z));
    let (ball, bounds) = (body.circumscribed(), body.bounding_box());
    let terms: Vec<_> = body.constraints().iter().map(|c| c.polynomial.terms().len().to_string()).collect();
    writeln!(out, "{}", body.name())?;
    writeln!(out, "  id              {}", body.id())?;
    writeln!(out, "  degree          {}, {} constraint(s) of {} terms", body.degree(), terms.len(), terms.join(", "))?;
    writeln!(
        out,
        "  volume          {:.6e} m³ (quadrature error about {:.0e})",
        body.volume().volume_m3,
        body.volume().error_m3
    )?;
    writeln!(out, "  bounding box    {} to {} m", list(&bounds.min), list(&bounds.max))?;
    writeln!(out, "  circumscribed   ball of radius {} m about {} m", length(ball.radius), list(&ball.center))?;
    writeln!(
        out,
        "  interior point  {} m, with a ball of radius {} m inside",
        list(body.interior_point()),
        length(body.in_radius())
    )?;
    writeln!(out, "  min value       {:.6e}", body.min_value())?;
    if let Some(points) = body.points() {
        writeln!(
            out,
            "  fitted around   {} points, sha256 {} ('verify --points' proves it)",
            points.count, points.sha256
        )?;
    }
    for set in body.sets() {
        writeln!(out, "  contains        {}, id {} ('verify --contains' proves it)", set.name, set.id)?;
    }
    if let Some(gap) = body.gap_m() {
        writeln!(out, "  gap             at most {} m beyond the convex hull of its object", length(gap))?;
    }
    if let Some(provenance) = body.provenance() {
        let refined = if provenance.refined { ", refined" } else { "" };
        writeln!(
            out,
            "  fitted          to {}, objective {}{refined}; hull of {} vertices, {:.6e} m³",
            provenance.input, provenance.objective, provenance.hull_vertices, provenance.hull_volume_m3
        )?;
    }
    writeln!(out, "  proven          sos-convex, bounded, interior not empty")
}

/// The surface as OBJ text: the boundary along the vertices of a subdivided icosahedron.
fn mesh(body: &Body) -> String {
    let sphere = Sphere::subdivided(4);
    let mirrored = body.normalization().linear.determinant() < 0.0;
    let mut text = format!("# {} ({})\n", body.name(), body.id());
    // Writing to a string can not fail.
    for direction in sphere.vertices() {
        let x = body.boundary_along(direction);
        let _ = writeln!(text, "v {} {} {}", x.x, x.y, x.z);
    }
    for &[a, b, c] in sphere.triangles() {
        let (b, c) = if mirrored { (c, b) } else { (b, c) };
        let _ = writeln!(text, "f {} {} {}", a + 1, b + 1, c + 1);
    }
    text
}

fn silhouettes(body: &Body) -> String {
    let points = boundary_points(|direction| body.boundary_along(direction), SILHOUETTE_POINTS);
    let panel = |view: View| Panel {
        caption: view.name().into(),
        outlines: vec![Outline::body(Ink::Blue, outline(&points, view))],
    };
    let rows = vec![[View::Side, View::Front, View::Top].map(panel).into()];
    let legend = vec![(Ink::Blue, format!("degree {}", body.degree()))];
    Silhouettes { title: body.name().into(), legend, rows }.to_svg()
}
