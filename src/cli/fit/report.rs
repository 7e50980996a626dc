//! What was made of an input: its files, and what is said of it.

use super::reading_row::ReadingRow;
use super::sos;
use crate::body::{Body, Compound, SosMethod};
use crate::cli::files::write_atomically;
use crate::fit::{RefinementEnd, Solver};
use crate::jobs::{FitOutput, Shapes};
use crate::scene::Geometry;
use crate::store::{FitMode, FitOutcome, FitRequest, FittedBody};
use serde::Serialize;
use std::error::Error;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A line of the table.
#[derive(Serialize)]
#[serde(untagged)]
pub(super) enum Row {
    Convex(Convex),
    Sos(sos::Row),
}

/// A body or a compound.
#[derive(Serialize)]
pub(super) struct Convex {
    input: String,
    body: String,
    degree: usize,
    slabs: usize,
    /// 1 for a body that is no compound.
    parts: usize,
    /// What --parts asked for, and why fewer came out if they did.
    parts_asked: Option<usize>,
    shortfall: Option<String>,
    /// What a compound is proven to cover of the mesh: "interior" or "surface_only".
    covers: Option<&'static str>,
    /// What was minimised: the objective, or the radius of a ball.
    objective: String,
    refined: bool,
    points: usize,
    /// Points that were trimmed, and the largest distance of one of them from the hull of the
    /// others.
    left_out: usize,
    left_out_m: f64,
    #[serde(flatten)]
    reading: ReadingRow,
    hull_vertices: usize,
    /// Of a compound the union of its parts, which may overlap.
    volume_m3: f64,
    volume_error_m3: f64,
    hull_volume_m3: f64,
    /// Proven bound of the distance of any point of the body from the hull, of a compound from the
    /// hulls of its pieces.
    gap_m: f64,
    /// Mean over directions of how much farther the body reaches than the hull; none for compounds.
    mean_gap_m: Option<f64>,
    seconds: f64,
    /// A fit that is not solved, or not proven, is an error.
    status: &'static str,
    proven: bool,
    #[serde(flatten)]
    solve: Option<Solve>,
}

/// What only fits of polynomials have.
#[derive(Serialize)]
struct Solve {
    /// Why the refinement ended; none without.
    refinement: Option<String>,
    objective_value: f64,
    optimality_gap: Option<f64>,
    /// What solved the program, and why another did not.
    solver: Option<Solver>,
    fallback: Option<String>,
}

/// A mesh that was read.
pub(super) struct InputMesh<'a> {
    pub(super) path: &'a Path,
    /// Vertices that its triangles use.
    pub(super) used_points: usize,
    pub(super) reading: ReadingRow,
}

/// Writes what was made of a mesh, and describes it.
pub(super) fn write(
    folder: &Path,
    &InputMesh { path: input, used_points: used, ref reading }: &InputMesh<'_>,
    request: &FitRequest,
    made: &FitOutput,
) -> Result<Vec<Row>, Box<dyn Error>> {
    let FitOutput { outcome, shapes, ladder } = made;
    let write = |kind: String, json: String| -> Result<PathBuf, Box<dyn Error>> {
        let file = folder.join(format!("{}-{kind}.json", request.name));
        write_atomically(&file, &json)?;
        Ok(file)
    };
    if let Some(ladder) = ladder {
        // All rungs in one file, for scenes.
        write("ladder".to_owned(), Geometry::Ladder(ladder.clone()).to_json())?;
    }
    let mut rows = match shapes {
        Shapes::Bodies(bodies) => {
            let one = |(body, took): (&Body, &FittedBody)| {
                let file = write(kind(body, took), body.to_json())?;
                note_refinement(&file, took);
                note_fallback(&file, took);
                Ok(Row::Convex(body_row(input, &file, outcome, body, took)))
            };
            bodies.iter().zip(&outcome.bodies).map(one).collect::<Result<_, Box<dyn Error>>>()?
        }
        Shapes::Compound(compound) => {
            let file = write(format!("d{}-p{}", compound.degree(), compound.parts().len()), compound.to_json())?;
            let mut row = compound_row(input, &file, used, compound, &outcome.bodies[0]);
            row.parts_asked = parts_asked(request);
            row.shortfall = shortfall(row.parts_asked, compound, &outcome.bodies[0]);
            if let (Some(asked), Some(reason)) = (row.parts_asked, &row.shortfall) {
                eprintln!("note: {}: {} of {asked} parts: {reason}", input.display(), row.parts);
            }
            vec![Row::Convex(row)]
        }
        Shapes::SosBody(body) => {
            let file = write(format!("d{}-{}", body.degree(), method(request)), body.to_json())?;
            vec![Row::Sos(sos::row(input, &file, outcome, body))]
        }
    };
    for row in &mut rows {
        match row {
            Row::Convex(row) => row.reading = reading.clone(),
            Row::Sos(row) => row.reading = reading.clone(),
        }
    }
    note_left_out(input, outcome, &rows);
    Ok(rows)
}

/// How the file of a body is distinguished from others of its object.
fn kind(body: &Body, took: &FittedBody) -> String {
    match (&took.optimum, body.constraints().len() - 1) {
        (None, _) => "ball".to_owned(),
        (Some(_), 0) => format!("d{}", body.degree()),
        (Some(_), slabs) => format!("d{}-s{slabs}", body.degree()),
    }
}

/// How the file of an sos-body is distinguished from others of its object and degree.
fn method(request: &FitRequest) -> String {
    match &request.mode {
        FitMode::SosBody(set) => match set.method {
            SosMethod::Relaxed { c, .. } => format!("c{c}"),
            SosMethod::InverseMoment => "im".to_owned(),
        },
        // Only that mode makes sos-bodies.
        _ => "sos".to_owned(),
    }
}

fn parts_asked(request: &FitRequest) -> Option<usize> {
    match &request.mode {
        FitMode::Compound(compound) => Some(compound.parts),
        _ => None,
    }
}

/// Why a compound has fewer parts than were asked for.
fn shortfall(asked: Option<usize>, compound: &Compound, took: &FittedBody) -> Option<String> {
    asked.filter(|&asked| compound.parts().len() < asked)?;
    let unknown = || "more would not reduce the volume of the hulls (a server's answer has no details)".to_owned();
    Some(took.shortfall.clone().unwrap_or_else(unknown))
}

fn note_refinement(file: &Path, took: &FittedBody) {
    let end = took.optimum.as_ref().and_then(|optimum| optimum.refinement_end.as_ref());
    if let Some(end) = end.filter(|end| **end != RefinementEnd::Converged.to_string()) {
        eprintln!("note: {}: the refinement ended early: {end}; the body is proven all the same", file.display());
    }
}

fn note_fallback(file: &Path, took: &FittedBody) {
    let optimum = took.optimum.as_ref();
    if let Some((solver, why)) = optimum.and_then(|optimum| optimum.solver.zip(optimum.fallback.as_ref())) {
        eprintln!("note: {}: solved by {solver}, since {why}", file.display());
    }
}

fn note_left_out(input: &Path, outcome: &FitOutcome, rows: &[Row]) {
    let FitOutcome { left_out, left_out_m, .. } = outcome;
    let kept = match rows.first() {
        Some(Row::Convex(row)) => row.points,
        Some(Row::Sos(row)) => row.points,
        None => 0,
    };
    if *left_out > 0 {
        let (input, all) = (input.display(), left_out + kept);
        eprintln!(
            "note: {input}: {left_out} of {all} points left out, up to {left_out_m:.3e} m outside the hull of the others"
        );
    }
}

fn body_row(input: &Path, file: &Path, outcome: &FitOutcome, body: &Body, took: &FittedBody) -> Convex {
    let made = body.provenance().cloned().unwrap_or_default();
    Convex {
        input: input.display().to_string(),
        body: file.display().to_string(),
        degree: body.degree(),
        slabs: body.constraints().len() - 1,
        parts: 1,
        parts_asked: None,
        shortfall: None,
        covers: None,
        objective: made.objective,
        refined: made.refined,
        points: body.points().map_or(0, |points| points.count),
        left_out: outcome.left_out,
        left_out_m: outcome.left_out_m,
        reading: ReadingRow::default(),
        hull_vertices: made.hull_vertices,
        volume_m3: body.volume().volume_m3,
        volume_error_m3: body.volume().error_m3,
        hull_volume_m3: made.hull_volume_m3,
        gap_m: took.gap_m.unwrap_or(f64::INFINITY),
        mean_gap_m: took.mean_gap_m,
        seconds: took.seconds,
        status: "solved",
        proven: true,
        solve: took.optimum.as_ref().map(|optimum| Solve {
            refinement: optimum.refinement_end.clone(),
            objective_value: optimum.objective_value,
            optimality_gap: optimum.optimality_gap,
            solver: optimum.solver,
            fallback: optimum.fallback.clone(),
        }),
    }
}

fn compound_row(input: &Path, file: &Path, points: usize, compound: &Compound, took: &FittedBody) -> Convex {
    let parts = compound.parts();
    let made = compound.provenance().cloned().unwrap_or_default();
    let volume = compound.volume();
    Convex {
        input: input.display().to_string(),
        body: file.display().to_string(),
        degree: compound.degree(),
        slabs: parts.iter().map(|part| part.constraints().len() - 1).max().unwrap_or(0),
        parts: parts.len(),
        parts_asked: None,
        shortfall: None,
        covers: compound.covering().map(|covering| covering.proven.name()),
        objective: made.objective,
        refined: made.refined,
        points,
        left_out: 0,
        left_out_m: 0.0,
        reading: ReadingRow::default(),
        hull_vertices: made.hull_vertices,
        volume_m3: volume.volume_m3,
        volume_error_m3: volume.error_m3,
        hull_volume_m3: made.hull_volume_m3,
        gap_m: took.gap_m.unwrap_or(f64::INFINITY),
        mean_gap_m: None,
        seconds: took.seconds,
        status: "solved",
        proven: true,
        solve: None,
    }
}

/// Prints the rows, which are of one kind.
pub(super) fn table(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    let (mut convex, mut sos) = (Vec::new(), Vec::new());
    for row in rows {
        match row {
            Row::Convex(row) => convex.push(row),
            Row::Sos(row) => sos.push(row),
        }
    }
    if sos.is_empty() { convex_table(out, &convex) } else { sos::table(out, &sos) }
}

fn convex_table(out: &mut dyn Write, rows: &[&Convex]) -> io::Result<()> {
    let width = rows.iter().map(|row| row.body.chars().count()).max().unwrap_or(0).max(4);
    writeln!(
        out,
        "{:width$}  degree  slabs  parts  points  hull vertices    volume m³  volume:hull      gap m  mean gap m  seconds  proven",
        "body"
    )?;
    for row in rows {
        writeln!(
            out,
            "{:width$}  {:>6}  {:>5}  {:>5}  {:>6}  {:>13}  {:>11.4e}  {:>11.3}  {:>9.3e}  {:>10}  {:>7.2}  {:>6}",
            row.body,
            row.degree,
            row.slabs,
            row.parts,
            row.points,
            row.hull_vertices,
            row.volume_m3,
            row.volume_m3 / row.hull_volume_m3,
            row.gap_m,
            row.mean_gap_m.map_or("-".to_owned(), |mean| format!("{mean:.3e}")),
            row.seconds,
            if row.proven { "yes" } else { "no" }
        )?;
    }
    Ok(())
}
