//! `sublevel show` and `sublevel verify` of sos-bodies.

use super::files::read;
use super::outcome::{Outcome, one_line};
use super::verify_args::VerifyArgs;
use crate::body::{Coverage, SosBody, Uncovered};
use crate::robot::counted;
use serde::Serialize;
use serde_json::json;
use std::error::Error;
use std::io::{self, Write};
use std::path::Path;

/// Describes.
pub(super) fn show(file: &Path, as_json: bool) -> Result<(), Box<dyn Error>> {
    let body = SosBody::from_json(&read(file)?).map_err(|error| format!("{}: {error}", file.display()))?;
    let mut out = io::stdout().lock();
    if as_json {
        writeln!(out, "{:#}", summary(&body))?;
    } else {
        describe(&mut out, &body)?;
    }
    Ok(())
}

fn summary(body: &SosBody) -> serde_json::Value {
    let array = |v: &nalgebra::Vector3<f64>| json!([v.x, v.y, v.z]);
    let (ball, bounds) = (body.circumscribed(), body.bounding_box());
    json!({
        "id": body.id().to_string(),
        "name": body.name(),
        "kind": "sos-body",
        "degree": body.degree(),
        "relax_convexity": body.relaxation().map(|relaxation| relaxation.c),
        "interior_point_m": array(body.interior_point()),
        "circumscribed_ball": { "center_m": array(&ball.center), "radius_m": ball.radius },
        "bounding_box": { "min_m": array(&bounds.min), "max_m": array(&bounds.max) },
        "volume_m3": body.volume().volume_m3,
        "volume_error_m3": body.volume().error_m3,
        "points_only": true,
        "contained_points": body.points(),
        "coverage": body.covered(),
        "provenance": body.provenance(),
    })
}

fn describe(out: &mut impl Write, body: &SosBody) -> io::Result<()> {
    // Digits as small sets need them.
    let places = (7 - body.circumscribed().radius.log10().ceil() as i32).clamp(3, 15) as usize;
    let length = |x: f64| format!("{x:.places$}");
    let list = |v: &nalgebra::Vector3<f64>| format!("({}, {}, {})", length(v.x), length(v.y), length(v.z));
    let (ball, bounds, volume) = (body.circumscribed(), body.bounding_box(), body.volume());
    writeln!(out, "{}", body.name())?;
    writeln!(out, "  id              {}", body.id())?;
    writeln!(out, "  kind            sos-body: a set that need not be convex")?;
    writeln!(out, "  degree          {}, {} terms", body.degree(), body.polynomial().terms().len())?;
    writeln!(out, "  volume          {:.6e} m³ (quadrature error about {:.0e})", volume.volume_m3, volume.error_m3)?;
    writeln!(out, "  bounding box    {} to {} m", list(&bounds.min), list(&bounds.max))?;
    writeln!(out, "  circumscribed   ball of radius {} m about {} m", length(ball.radius), list(&ball.center))?;
    writeln!(out, "  interior point  {} m", list(body.interior_point()))?;
    if let Some(points) = body.points() {
        writeln!(
            out,
            "  fitted around   {}, sha256 {} ('verify --points' proves it)",
            counted(points.count, "point", "points"),
            points.sha256
        )?;
    }
    if let Some(coverage) = body.covered() {
        writeln!(out, "  triangles       {}", covering(coverage))?;
    }
    if let Some(provenance) = body.provenance() {
        writeln!(
            out,
            "  fitted          to {}, {}; hull of {} vertices, {:.6e} m³",
            provenance.input, provenance.objective, provenance.hull_vertices, provenance.hull_volume_m3
        )?;
    }
    writeln!(out, "  proven          {}", claim(body))
}

/// What the file alone proves.
fn claim(body: &SosBody) -> String {
    let convex =
        body.relaxation().map(|relaxation| format!(", sos-convex with {} |u|^{} added", relaxation.c, body.degree()));
    format!("a sum of squares{}, bounded, interior not empty; not convex, points only", convex.unwrap_or_default())
}

fn covering(coverage: &Coverage) -> String {
    let Coverage { triangles, uncovered, area_m2, uncovered_area_m2, largest } = coverage;
    let Some(Uncovered { triangle, area_m2: area, value, value_upper }) = largest else {
        return format!("all {triangles} proven inside");
    };
    format!(
        "{uncovered} of {triangles} not proven inside whole ({:.2} % of the area); the largest, number {triangle} of {area:.3e} m², reaches \
         the value {value:.6} (at most {value_upper:.6})",
        100.0 * uncovered_area_m2 / area_m2.max(f64::MIN_POSITIVE)
    )
}

#[derive(Default, Serialize)]
struct Report {
    kind: &'static str,
    sos_proven: bool,
    /// c of the proven relaxation; none if none is claimed.
    relax_convexity: Option<f64>,
    contains_all_points_proven: Option<bool>,
    /// Rigorous upper bound of the polynomial over the points.
    max_value: Option<f64>,
    points_only: bool,
    coverage: Option<Coverage>,
    degree: Option<usize>,
}

/// Proves, prints, and returns whether every claim is proven.
pub(super) fn verify(args: &VerifyArgs, text: &str) -> Outcome {
    let mut report = Report { kind: "sos-body", points_only: true, ..Report::default() };
    let mut sentences = Vec::new();
    let trouble = match SosBody::from_json(text) {
        Ok(body) => {
            report.sos_proven = true;
            report.relax_convexity = body.relaxation().map(|relaxation| relaxation.c);
            report.degree = Some(body.degree());
            sentences.push(format!("{}: proven {}", args.file.display(), claim(&body)));
            contained(args, &body, &mut report, &mut sentences)?
        }
        Err(error) => Some(format!("{}: {error}", args.file.display())),
    };
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer(&mut out, &report)?;
        writeln!(out)?;
    } else {
        sentences.iter().try_for_each(|sentence| writeln!(out, "{sentence}"))?;
    }
    if let Some(trouble) = &trouble {
        eprintln!("error: {}", one_line(trouble));
    }
    Ok(trouble.is_none())
}

/// Proves the points, and the triangles as far as they are; what does not hold.
#[cfg(feature = "fit")]
fn contained(
    args: &VerifyArgs,
    body: &SosBody,
    report: &mut Report,
    sentences: &mut Vec<String>,
) -> Result<Option<String>, Box<dyn Error>> {
    let Some(path) = &args.points else { return Ok(None) };
    let reading = args.mesh.read(path)?;
    super::mesh::note(path, &reading);
    let mesh = reading.mesh;
    let fitted_to = body.points().is_some_and(|known| *known == crate::body::ContainedPoints::of(&mesh.points));
    if body.points().is_some() && !fitted_to {
        eprintln!("note: these are not the points that the set was fitted to");
    }
    match body.prove_contains(&mesh.points) {
        Ok(value) => {
            (report.contains_all_points_proven, report.max_value) = (Some(true), Some(value));
            sentences.push(format!("proven to contain every point: the largest value is at most {value}"));
        }
        Err(failure) => {
            (report.contains_all_points_proven, report.max_value) = (Some(false), Some(failure.value));
            return Ok(Some(format!("{}: {failure}", path.display())));
        }
    }
    if mesh.triangles.is_empty() {
        return Ok(None);
    }
    let found = body.coverage(&mesh.points, &mesh.triangles)?;
    sentences.push(format!("triangles: {}", covering(&found)));
    report.coverage = Some(found);
    // Of other points the file says nothing.
    let stored = body.covered().filter(|stored| fitted_to && stored.uncovered < found.uncovered);
    Ok(stored.map(|stored| {
        let (file, less, more) = (args.file.display(), stored.uncovered, found.uncovered);
        format!("{file}: coverage says {less} uncovered triangles but {more} are not proven inside; fit the set again")
    }))
}

#[cfg(not(feature = "fit"))]
fn contained(
    _: &VerifyArgs,
    _: &SosBody,
    _: &mut Report,
    _: &mut Vec<String>,
) -> Result<Option<String>, Box<dyn Error>> {
    Ok(None)
}
