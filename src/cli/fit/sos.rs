//! `sublevel fit` of sets that need not be convex.

use super::{FitArgs, Prepared, coordinates, file_name, progress_bar, telling};
use crate::body::{Coverage, SosBody};
use crate::cli::write_atomically;
use crate::fit::{Objective, SosFit, SosMethod, SosOptions, SosReport, Trimmed, UnknownObjective, fit_sos};
use serde::Serialize;
use std::error::Error;
use std::fmt;
use std::io::{self, Write};
use std::path::Path;
use std::str::FromStr;

/// What `--objective` names.
#[derive(Clone, Copy, Debug)]
pub(super) enum Choice {
    /// An objective of a program.
    Minimise(Objective),
    /// The inverse moment, which minimises nothing.
    InverseMoment,
}

impl Default for Choice {
    fn default() -> Self {
        Self::Minimise(Objective::default())
    }
}

impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Minimise(objective) => objective.fmt(f),
            Self::InverseMoment => f.write_str(SosMethod::InverseMoment.name()),
        }
    }
}

impl FromStr for Choice {
    type Err = UnknownObjective;

    fn from_str(name: &str) -> Result<Self, UnknownObjective> {
        if name == SosMethod::InverseMoment.name() {
            return Ok(Self::InverseMoment);
        }
        name.parse().map(Self::Minimise)
    }
}

/// How to make a set that need not be convex, if one is asked for.
pub(super) fn method(args: &FitArgs) -> Result<Option<SosMethod>, String> {
    let c = args.relax_convexity;
    let method = match args.objective {
        Choice::Minimise(_) if c == 0.0 => return Ok(None),
        Choice::Minimise(objective) => SosMethod::Relaxed { c, objective },
        Choice::InverseMoment if c == 0.0 => SosMethod::InverseMoment,
        Choice::InverseMoment => {
            return Err("--relax-convexity: inverse-moment asks for no convexity; leave one of the two out".into());
        }
    };
    if args.refine || args.ladder || args.slabs > 0 || args.max_gap.is_some() || args.parts.is_some() {
        let wanted = "--refine, --ladder, --slabs, --parts and --max-gap need convex bodies; leave them out";
        return Err(format!("{wanted}, or --relax-convexity and inverse-moment"));
    }
    Ok(Some(method))
}

pub(super) fn options(args: &FitArgs, method: SosMethod, input: &Path) -> SosOptions {
    let degree = args.degree.unwrap_or(6);
    SosOptions { degree, method, coordinates: coordinates(args), input: file_name(input) }
}

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
    points: usize,
    /// Points that were trimmed, and the largest distance of one of them from the hull of the others.
    left_out: usize,
    left_out_m: f64,
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
    seconds: f64,
    status: &'static str,
    proven: bool,
}

/// Fits one input, writes and describes it.
pub(super) fn one(args: &FitArgs, method: SosMethod, input: &Path, stem: &str) -> Result<Row, Box<dyn Error>> {
    let bar = progress_bar(stem);
    let mut tell = telling(&bar);
    let Prepared { mesh, trimmed } = Prepared::new(args, input, &bar, &mut tell)?;
    let options = options(args, method, input);
    let SosFit { body, report } = fit_sos(stem, &mesh.points, &mesh.triangles, &options, &mut tell)
        .map_err(|error| format!("{}: {error}", input.display()))?;
    bar.finish_and_clear();
    let kind = match method {
        SosMethod::Relaxed { c, .. } => format!("c{c}"),
        SosMethod::InverseMoment => "im".into(),
    };
    let file = args.out.join(format!("{stem}-d{}-{kind}.json", body.degree()));
    write_atomically(&file, &body.to_json())?;
    Ok(row(input, &file, &body, &report, trimmed.as_ref()))
}

fn row(input: &Path, file: &Path, body: &SosBody, report: &SosReport, trimmed: Option<&Trimmed>) -> Row {
    Row {
        input: input.display().to_string(),
        body: file.display().to_string(),
        kind: "sos-body",
        degree: body.degree(),
        objective: body.provenance().map(|made| made.objective.clone()).unwrap_or_default(),
        relax_convexity: body.relaxation().map(|relaxation| relaxation.c),
        points: report.points,
        left_out: trimmed.map_or(0, |trimmed| trimmed.left_out.len()),
        left_out_m: trimmed.map_or(0.0, |trimmed| trimmed.farthest_m),
        hull_vertices: report.hull_vertices,
        volume_m3: body.volume().volume_m3,
        volume_error_m3: body.volume().error_m3,
        hull_volume_m3: report.hull_volume_m3,
        points_only: true,
        coverage: body.covered().copied(),
        objective_value: report.program.map(|program| program.objective_value),
        optimality_gap: report.program.map(|program| program.optimality_gap),
        seconds: report.seconds,
        // A fit returns a set only when it is solved and proven.
        status: "solved",
        proven: true,
    }
}

pub(super) fn table(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
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
