//! `sublevel verify`.

use super::files::{read, read_obstacle};
#[cfg(feature = "fit")]
use super::mesh::note;
use super::outcome::{Outcome, one_line};
use super::sos_body;
use super::verify_args::VerifyArgs;
use crate::body::{BasicSet, Body, Compound, Obstacle, Shape, SosBody};
#[cfg(feature = "fit")]
use crate::body::{Covering, Division, NotCovered, Piece};
#[cfg(feature = "fit")]
use crate::fit::Mesh;
use crate::robot::counted;
use crate::robot::motion::Certificate;
#[cfg(feature = "fit")]
use nalgebra::Vector3;
use serde::Serialize;
use std::io::{self, Write};
use std::path::Path;

#[derive(Serialize)]
struct Report {
    sos_convex_proven: bool,
    contains_all_points_proven: Option<bool>,
    /// Rigorous upper bound of the largest constraint over the points.
    max_value: Option<f64>,
    /// Whether each body of --contains is proven inside, in their order.
    contains_sets_proven: Option<Vec<bool>>,
    degree: Option<usize>,
    /// Proven bound of the distance of any point of the body from the convex hull of the points,
    /// metres; of a compound from those of the pieces of the mesh.
    gap_m: Option<f64>,
    /// What is proven to be covered of the mesh: "interior" or "surface_only"; of compounds.
    #[serde(skip_serializing_if = "Option::is_none")]
    covers: Option<&'static str>,
}

/// What certificates of motions begin with, those as well that were cut off and are no JSON any
/// more.
const CERTIFICATE: &str = "{\"format\":\"sublevel motion certificate";

/// Proves, prints, and returns whether every claim is proven.
pub(super) fn run(args: &VerifyArgs) -> Outcome {
    #[cfg(feature = "fit")]
    if args.points.is_none() && args.mesh.are_given() {
        return Err(
            "--scale, --drop-nan and --drop-unused are about the mesh of --points; name it, or leave them out".into()
        );
    }
    let text = read(&args.file)?;
    if Certificate::is_file(&text) || text.trim_start().starts_with(CERTIFICATE) {
        return motion(args, &text);
    }
    if SosBody::is_file(&text) {
        return sos_body::verify(args, &text);
    }
    let (report, trouble) = match Shape::from_json(&text) {
        Ok(Shape::Body(body)) => {
            let (mut report, mut trouble) = contained(args, &body)?;
            if !args.contains.is_empty() {
                let failures = args.contains.iter().map(|path| inside(path, &body)).collect::<Result<Vec<_>, _>>()?;
                report.contains_sets_proven = Some(failures.iter().map(Option::is_none).collect());
                trouble = trouble.or_else(|| failures.into_iter().flatten().next());
            }
            (report, trouble)
        }
        Ok(Shape::Compound(_)) if !args.contains.is_empty() => {
            return Err(
                "--contains: only a single body is proven to contain others, not a compound; leave it out".into()
            );
        }
        Ok(Shape::Compound(compound)) => covered(args, &compound)?,
        Err(error) => {
            let report = Report {
                sos_convex_proven: false,
                contains_all_points_proven: None,
                max_value: None,
                contains_sets_proven: None,
                degree: None,
                gap_m: None,
                covers: None,
            };
            (report, Some(format!("{}: {error}", args.file.display())))
        }
    };
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer(&mut out, &report)?;
        writeln!(out)?;
    } else if report.sos_convex_proven {
        writeln!(out, "{}: proven sos-convex, bounded, and as its file says", args.file.display())?;
        if let (Some(true), Some(value)) = (report.contains_all_points_proven, report.max_value) {
            let what = match report.covers {
                None => "to contain every point",
                Some("interior") => "to cover every triangle and the interior",
                Some(_) => "to cover every triangle (the mesh is not closed)",
            };
            writeln!(out, "proven {what}: the largest value is at most {value}")?;
        }
        if let Some(gap) = report.gap_m {
            let hull = if report.covers.is_some() { "the convex hulls of its pieces" } else { "their convex hull" };
            writeln!(out, "proven to reach at most {gap:.3e} m beyond {hull}")?;
        }
        for (path, proven) in args.contains.iter().zip(report.contains_sets_proven.iter().flatten()) {
            let verdict = if *proven { "proven to contain" } else { "not proven to contain" };
            writeln!(out, "{verdict} all of {}", path.display())?;
        }
    }
    if let Some(trouble) = &trouble {
        eprintln!("error: {}", one_line(trouble));
    }
    Ok(trouble.is_none())
}

/// What a certificate of a motion proves.
#[derive(Serialize)]
struct MotionReport {
    free_proven: bool,
    /// All pairs keep at least this signed distance less their padding, metres; none if there are
    /// no pairs, or if nothing is proven.
    clearance_lower_m: Option<f64>,
    margin_m: Option<f64>,
    configurations: Option<usize>,
}

/// Checks the certificate of a motion.
fn motion(args: &VerifyArgs, text: &str) -> Outcome {
    #[cfg(feature = "fit")]
    let has_points = args.points.is_some();
    #[cfg(not(feature = "fit"))]
    let has_points = false;
    if has_points || !args.contains.is_empty() {
        return Err(
            "--points and --contains are about bodies, not about the certificate of a motion; leave them out".into()
        );
    }
    let checked = Certificate::from_json(text).and_then(|certificate| Ok((certificate.verify()?, certificate)));
    let (report, trouble) = match &checked {
        Ok((verified, certificate)) => {
            let report = MotionReport {
                free_proven: true,
                clearance_lower_m: Some(verified.clearance_lower_m).filter(|clearance| clearance.is_finite()),
                margin_m: Some(certificate.margin_m()),
                configurations: Some(verified.configurations),
            };
            (report, None)
        }
        Err(error) => {
            let report =
                MotionReport { free_proven: false, clearance_lower_m: None, margin_m: None, configurations: None };
            (report, Some(format!("{}: {error}", args.file.display())))
        }
    };
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer(&mut out, &report)?;
        writeln!(out)?;
    } else if let Ok((verified, certificate)) = &checked {
        let segments = counted(certificate.path().segments(), "segment", "segments");
        writeln!(out, "{}: proven free over all of its path of {segments}", args.file.display())?;
        if verified.pairs == 0 {
            writeln!(out, "there are no pairs that could touch")?;
        } else {
            // Rounded downwards.
            let least = (verified.clearance_lower_m * 1e4).floor() / 1e4;
            let pairs = counted(verified.pairs, "pair keeps", "pairs keep");
            let configurations = counted(verified.configurations, "configuration", "configurations");
            writeln!(out, "{pairs} at least {least:.4} m, by {configurations}")?;
        }
    }
    if let Some(trouble) = &trouble {
        eprintln!("error: {}", one_line(trouble));
    }
    Ok(trouble.is_none())
}

#[cfg(feature = "fit")]
fn contained(args: &VerifyArgs, body: &Body) -> Result<(Report, Option<String>), Box<dyn std::error::Error>> {
    let mut report = proven(body.degree());
    let Some(path) = &args.points else { return Ok((report, None)) };
    let reading = args.mesh.read(path)?;
    note(path, &reading);
    let points = reading.mesh.points;
    let fitted_to = body.points().is_some_and(|recorded| *recorded == crate::body::ContainedPoints::of(&points));
    if body.points().is_some() && !fitted_to {
        eprintln!("note: these are not the points that the body was fitted to");
    }
    let (value, mut trouble) = match body.prove_contains(&points) {
        Ok(value) => (value, None),
        Err(failure) => (failure.value, Some(format!("{}: {failure}", path.display()))),
    };
    report.contains_all_points_proven = Some(trouble.is_none());
    report.max_value = Some(value);
    // Points outside have no hull inside the body.
    if trouble.is_none() {
        (report.gap_m, trouble) = gap(args, body, &points, 0.0, fitted_to);
    }
    Ok((report, trouble))
}

/// How far a body reaches beyond the hull of points inside, which are known up to a clearance, and
/// what is wrong with its own note of that, if it is about these points.
#[cfg(feature = "fit")]
fn gap(
    args: &VerifyArgs,
    body: &Body,
    points: &[Vector3<f64>],
    clearance: f64,
    fitted_to: bool,
) -> (Option<f64>, Option<String>) {
    let hull = match crate::fit::hull::convex_hull(points) {
        Ok(hull) => hull,
        Err(error) => {
            eprintln!("note: no gap is bounded: {error}");
            return (None, None);
        }
    };
    let vertices: Vec<_> = hull.vertices.iter().map(|&i| points[i]).collect();
    let gap = crate::fit::gap(body, &vertices).most_m + clearance;
    // Of other points the file says nothing.
    let trouble = body.gap_m().filter(|&stored| fitted_to && stored < gap * (1.0 - 1e-6)).map(|stored| {
        let file = args.file.display();
        format!("{file}: gap_m is {stored:e} but only {gap:e} m can be proven; fit the body again")
    });
    (Some(gap), trouble)
}

/// As [`contained`], of a compound and a mesh.
#[cfg(feature = "fit")]
fn covered(args: &VerifyArgs, compound: &Compound) -> Result<(Report, Option<String>), Box<dyn std::error::Error>> {
    let mut report = proven(compound.degree());
    let Some(path) = &args.points else { return Ok((report, None)) };
    let reading = args.mesh.read(path)?;
    note(path, &reading);
    let Mesh { points, triangles } = reading.mesh;
    let covering = compound.covering();
    let division = covering.map_or_else(Division::default, |covering| covering.division.clone());
    let proof = compound.prove_covers(&points, &triangles, &division);
    report.contains_all_points_proven = Some(proof.is_ok());
    let (proven, value) = match proof {
        Ok(proof) => proof,
        Err(failure) => {
            if let NotCovered::Part { source, .. } = failure {
                report.max_value = Some(source.value);
            }
            return Ok((report, Some(format!("{}: {failure}", path.display()))));
        }
    };
    (report.max_value, report.covers) = (Some(value), Some(proven.name()));
    let fitted_to = covering.is_some_and(|covering| covering.corners == Covering::corners(&points, &triangles));
    let mut trouble = None;
    if fitted_to {
        let stored = covering.map(|covering| covering.proven).filter(|&stored| stored != proven);
        trouble = stored.map(|stored| {
            let (stored, proven) = (stored.name(), proven.name());
            format!("{}: covering.proven is {stored}, but {proven} is", args.file.display())
        });
    } else if covering.is_some() {
        eprintln!("note: this is not the mesh that the compound was fitted to");
    }
    let mut most = Some(0.0);
    let pieces = division.pieces(Piece::of_mesh(&points, &triangles)?, compound.parts().len())?;
    for (part, pieces) in compound.parts().iter().zip(pieces) {
        let points: Vec<_> = pieces.iter().flat_map(Piece::spots).map(|spot| spot.x).collect();
        let uncertainty = pieces.iter().map(Piece::uncertainty).fold(0.0, f64::max);
        let (gap, wrong) = gap(args, part, &points, uncertainty, fitted_to);
        most = most.zip(gap).map(|(most, gap): (f64, f64)| most.max(gap));
        trouble = trouble.or(wrong);
    }
    report.gap_m = most;
    Ok((report, trouble))
}

#[cfg(not(feature = "fit"))]
fn contained(_: &VerifyArgs, body: &Body) -> Result<(Report, Option<String>), Box<dyn std::error::Error>> {
    Ok((proven(body.degree()), None))
}

/// Proves a body inside by the stored proof or a new one; else says why not.
fn inside(path: &Path, body: &Body) -> Result<Option<String>, Box<dyn std::error::Error>> {
    let inner = read_obstacle(path)?;
    if inner.id() == body.id() {
        return Ok(None);
    }
    let failure = match body.sets().iter().find(|set| set.id == *inner.id()) {
        Some(set) => {
            set.containment.prove(&BasicSet::from(body), &BasicSet::from(&inner)).err().map(|error| error.to_string())
        }
        None => new_proof(body, &inner),
    };
    Ok(failure.map(|failure| format!("{}: {failure}", path.display())))
}

#[cfg(feature = "fit")]
fn new_proof(body: &Body, inner: &Obstacle) -> Option<String> {
    let degree = crate::fit::EncloseOptions::new(body.degree()).multiplier_degree;
    crate::fit::containment(body, &inner.into(), degree).err().map(|error| error.to_string())
}

#[cfg(not(feature = "fit"))]
fn new_proof(_: &Body, _: &Obstacle) -> Option<String> {
    Some("the body's file has no proof that it contains this body, and making one needs the feature 'fit'".into())
}

#[cfg(not(feature = "fit"))]
fn covered(_: &VerifyArgs, compound: &Compound) -> Result<(Report, Option<String>), Box<dyn std::error::Error>> {
    Ok((proven(compound.degree()), None))
}

fn proven(degree: usize) -> Report {
    Report {
        sos_convex_proven: true,
        contains_all_points_proven: None,
        max_value: None,
        contains_sets_proven: None,
        degree: Some(degree),
        gap_m: None,
        covers: None,
    }
}
