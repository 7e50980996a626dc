//! What `sublevel fit` says of sets that need not be convex.

use super::reading_row::ReadingRow;
use crate::body::{Coverage, Solver, SosBody};
use crate::store::FitOutcome;
use serde::Serialize;
use std::io::{self, Write};
use std::path::Path;

#[derive(Serialize)]
pub(super) struct Row {
    input: String,
    body: String,
    kind: &'static str,
    degree: usize,
    /// What was minimised, or `inverse-moment`.
    objective: String,
    /// c; none where nothing bounds convexity.
    relax_convexity: Option<f64>,
    pub(super) points: usize,
    /// Points that were trimmed, and the largest distance of one of them from the hull of the
    /// others.
    left_out: usize,
    left_out_m: f64,
    #[serde(flatten)]
    pub(super) reading: ReadingRow,
    hull_vertices: usize,
    volume_m3: f64,
    volume_error_m3: f64,
    hull_volume_m3: f64,
    /// Only the points are proven inside.
    points_only: bool,
    /// Which triangles are, too; none without triangles.
    coverage: Option<Coverage>,
    objective_value: Option<f64>,
    optimality_gap: Option<f64>,
    /// What solved the program, and why another did not.
    solver: Option<Solver>,
    fallback: Option<String>,
    seconds: f64,
    status: &'static str,
    proven: bool,
}

pub(super) fn row(input: &Path, file: &Path, outcome: &FitOutcome, body: &SosBody) -> Row {
    let made = body.provenance().cloned().unwrap_or_default();
    let took = outcome.bodies.first();
    let optimum = took.and_then(|took| took.optimum.as_ref());
    Row {
        input: input.display().to_string(),
        body: file.display().to_string(),
        kind: "sos-body",
        degree: body.degree(),
        objective: made.objective,
        relax_convexity: body.relaxation().map(|relaxation| relaxation.c),
        points: body.points().map_or(0, |points| points.count),
        left_out: outcome.left_out,
        left_out_m: outcome.left_out_m,
        reading: ReadingRow::default(),
        hull_vertices: made.hull_vertices,
        volume_m3: body.volume().volume_m3,
        volume_error_m3: body.volume().error_m3,
        hull_volume_m3: made.hull_volume_m3,
        points_only: true,
        coverage: body.covered().copied(),
        objective_value: optimum.map(|optimum| optimum.objective_value),
        optimality_gap: optimum.and_then(|optimum| optimum.optimality_gap),
        solver: optimum.and_then(|optimum| optimum.solver),
        fallback: optimum.and_then(|optimum| optimum.fallback.clone()),
        seconds: took.map_or(0.0, |took| took.seconds),
        // A fit returns a set only when it is solved and proven.
        status: "solved",
        proven: true,
    }
}

pub(super) fn table(out: &mut dyn Write, rows: &[&Row]) -> io::Result<()> {
    let width = rows.iter().map(|row| row.body.chars().count()).max().unwrap_or(0).max(4);
    writeln!(
        out,
        "{:width$}  degree  points    volume m³  volume:hull  seconds  proven       uncovered triangles  largest m²",
        "body"
    )?;
    for row in rows {
        let (uncovered, largest) = row.coverage.map_or(("no mesh".to_owned(), "-".to_owned()), |coverage| {
            let largest = coverage.largest.map_or_else(|| "-".into(), |largest| format!("{:.3e}", largest.area_m2));
            (format!("{} of {}", coverage.uncovered, coverage.triangles), largest)
        });
        writeln!(
            out,
            "{:width$}  {:>6}  {:>6}  {:>11.4e}  {:>11.3}  {:>7.2}  points only  {uncovered:>19}  {largest:>10}",
            row.body,
            row.degree,
            row.points,
            row.volume_m3,
            row.volume_m3 / row.hull_volume_m3,
            row.seconds,
        )?;
    }
    Ok(())
}
