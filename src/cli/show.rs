//! `sublevel show`.

use super::files::{read, read_shape, write_atomically};
use super::sos_body;
use crate::body::{Body, Compound, Shape, Solid, SosBody, Sphere};
use crate::draw::{Ink, Outline, Panel, Silhouettes, View, boundary_points, outline};
use crate::robot::counted;
use serde_json::json;
use std::error::Error;
use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::PathBuf;

/// Boundary points that a silhouette is made of.
const SILHOUETTE_POINTS: usize = 6000;

/// Describe a body or a compound, export its surface, draw its silhouettes
///
/// The file is re-proven first, as by 'verify'. Lengths are metres in the body frame. Of an
/// sos-body, which need not be convex, only the description is printed.
///
/// Example: sublevel show bodies/mug-d6.json --mesh mug.obj --svg mug.svg
#[derive(Debug, clap::Args)]
pub(super) struct ShowArgs {
    /// File of a body or a compound
    file: PathBuf,
    /// Print one JSON object instead of lines
    #[arg(long)]
    json: bool,
    /// Write the surface as a triangle mesh, inscribed in the body up to rounding; of a compound
    /// that of each part
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
    let shape = read_shape(&args.file)?;
    if let Some(path) = &args.mesh {
        write_atomically(path, &mesh(shape.parts()))?;
    }
    if let Some(path) = &args.svg {
        write_atomically(path, &silhouettes(&shape))?;
    }
    let mut out = io::stdout().lock();
    match &shape {
        Shape::Body(body) if args.json => writeln!(out, "{:#}", summary(body))?,
        Shape::Body(body) => describe(&mut out, body)?,
        Shape::Compound(compound) if args.json => writeln!(out, "{:#}", summary_of_compound(compound))?,
        Shape::Compound(compound) => describe_compound(&mut out, compound)?,
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
    let constraints = counted(terms.len(), "constraint", "constraints");
    writeln!(out, "  degree          {}, {constraints} of {} terms", body.degree(), terms.join(", "))?;
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
            "  fitted around   {}, sha256 {} ('verify --points' proves it)",
            counted(points.count, "point", "points"),
            points.sha256
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

fn summary_of_compound(compound: &Compound) -> serde_json::Value {
    let (volume, bounds) = (compound.volume(), compound.bounding_box());
    json!({
        "id": compound.id().to_string(),
        "name": compound.name(),
        "kind": "compound",
        "degree": compound.degree(),
        "bounding_box": { "min_m": bounds.min.as_slice(), "max_m": bounds.max.as_slice() },
        "volume_m3": volume.volume_m3,
        "volume_error_m3": volume.error_m3,
        "gap_m": compound.gap_m(),
        "covering": compound.covering(),
        "provenance": compound.provenance(),
        "parts": compound.parts().iter().map(summary).collect::<Vec<_>>(),
    })
}

fn describe_compound(out: &mut impl Write, compound: &Compound) -> io::Result<()> {
    let volume = compound.volume();
    let length = |x: f64| format!("{x:.5}");
    let list = |v: &nalgebra::Vector3<f64>| format!("({}, {}, {})", length(v.x), length(v.y), length(v.z));
    let bounds = compound.bounding_box();
    writeln!(out, "{}", compound.name())?;
    writeln!(out, "  id              {}", compound.id())?;
    writeln!(out, "  compound        of {}", counted(compound.parts().len(), "part", "parts"))?;
    for (index, part) in compound.parts().iter().enumerate() {
        let gap = part.gap_m().map_or(String::new(), |gap| format!(", gap {gap:.3e} m"));
        let (degree, constraints) = (part.degree(), counted(part.constraints().len(), "constraint", "constraints"));
        let volume = part.volume().volume_m3;
        writeln!(out, "    {index:<14}degree {degree}, {constraints}, {volume:.6e} m³{gap}")?;
    }
    let (union, error) = (volume.volume_m3, volume.error_m3);
    writeln!(out, "  volume          {union:.6e} m³ of the union (quadrature error about {error:.0e})")?;
    writeln!(out, "  bounding box    {} to {} m", list(&bounds.min), list(&bounds.max))?;
    if let Some(covering) = compound.covering() {
        writeln!(
            out,
            "  covers          {} of {}, sha256 {} ('verify --points' proves it)",
            covering.proven.name(),
            counted(covering.corners.count / 3, "triangle", "triangles"),
            covering.corners.sha256
        )?;
    }
    if let Some(gap) = compound.gap_m() {
        writeln!(
            out,
            "  gap             at most {} m beyond the convex hulls of the pieces of its object",
            length(gap)
        )?;
    }
    if let Some(made) = compound.provenance() {
        let refined = if made.refined { ", refined" } else { "" };
        let (input, objective, vertices) = (&made.input, &made.objective, made.hull_vertices);
        writeln!(
            out,
            "  fitted          to {input}, objective {objective}{refined}; hull of {vertices} vertices, {:.6e} m³",
            made.hull_volume_m3
        )?;
    }
    writeln!(out, "  proven          every part sos-convex, bounded, interior not empty")
}

/// The surfaces as OBJ text: the boundaries along the vertices of a subdivided icosahedron.
fn mesh(parts: &[Body]) -> String {
    let sphere = Sphere::subdivided(4);
    let mut text = String::new();
    for (index, body) in parts.iter().enumerate() {
        let mirrored = body.normalization().linear.determinant() < 0.0;
        let first = 1 + index * sphere.vertices().len();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "# {} ({})", body.name(), body.id());
        for direction in sphere.vertices() {
            let x = body.boundary_along(direction);
            let _ = writeln!(text, "v {} {} {}", x.x, x.y, x.z);
        }
        for &[a, b, c] in sphere.triangles() {
            let (b, c) = if mirrored { (c, b) } else { (b, c) };
            let _ = writeln!(text, "f {} {} {}", a + first, b + first, c + first);
        }
    }
    text
}

fn silhouettes(shape: &Shape) -> String {
    let points = |body: &Body| boundary_points(|direction| body.boundary_along(direction), SILHOUETTE_POINTS);
    let points: Vec<_> = shape.parts().iter().map(points).collect();
    let panel = |view: View| Panel {
        caption: view.name().into(),
        outlines: points.iter().map(|points| Outline::body(Ink::Blue, outline(points, view))).collect(),
        spans: Vec::new(),
    };
    let rows = vec![[View::Side, View::Front, View::Top].map(panel).into()];
    let (name, what) = match shape {
        Shape::Body(body) => (body.name(), format!("degree {}", body.degree())),
        Shape::Compound(compound) => {
            let parts = counted(compound.parts().len(), "part", "parts");
            (compound.name(), format!("{parts}, degree {}", compound.degree()))
        }
    };
    Silhouettes { title: name.into(), legend: vec![(Ink::Blue, what)], rows }.to_svg()
}
