//! Shapes to body files, and the table of what came out.

use super::error::{DemoError, write};
use crate::body::Body;
use crate::fit::shapes::Shape;
use crate::fit::{FitOptions, FitReport, fit as fit_points};
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// A body that was fitted, written, read back and proven again.
#[derive(Debug)]
pub(super) struct Fitted {
    /// Name of the shape.
    pub(super) name: String,
    /// Its body file.
    pub(super) file: PathBuf,
    /// The content of the file.
    pub(super) body: Body,
    report: FitReport,
}

/// Fits a body of the given degree, writes it to `<name>-d<degree>.json` in `out`, and proves what
/// was written.
pub(super) fn fit(name: &str, shape: &Shape, degree: usize, out: &Path) -> Result<Fitted, DemoError> {
    let failed = |why: String| DemoError::Fit { name: name.into(), degree, why };
    let options = FitOptions { degree, input: format!("{name}.off"), ..FitOptions::default() };
    let fit = fit_points(name, &shape.vertices, &options, &mut |_| ControlFlow::Continue(()))
        .map_err(|error| failed(error.to_string()))?;

    let file = write(&out.join(format!("{name}-d{degree}.json")), &fit.body.to_json())?;
    let text = std::fs::read_to_string(&file).map_err(|source| DemoError::File { path: file.clone(), source })?;
    let body = Body::from_json(&text).map_err(|error| failed(error.to_string()))?;
    body.prove_contains(&shape.vertices).map_err(|error| failed(error.to_string()))?;
    Ok(Fitted { name: name.into(), file, body, report: fit.report })
}

/// The heading of the table.
pub(super) fn print_head(text: &mut impl Write) -> io::Result<()> {
    writeln!(
        text,
        "{:<6}  {:>6}  {:>6}  {:>9}  {:>7}  {:>11}  {:>7}  {:>6}",
        "shape", "degree", "points", "volume/m³", "hull/m³", "volume:hull", "seconds", "proven"
    )
}

/// One row. Only a body whose proofs succeeded comes this far.
pub(super) fn print_row(text: &mut impl Write, fitted: &Fitted) -> io::Result<()> {
    let report = &fitted.report;
    writeln!(
        text,
        "{:<6}  {:>6}  {:>6}  {:>9.4}  {:>7.4}  {:>11.3}  {:>7.2}  {:>6}",
        fitted.name,
        report.degree,
        report.points,
        report.volume_m3,
        report.hull_volume_m3,
        report.volume_m3 / report.hull_volume_m3,
        report.seconds,
        "yes"
    )?;
    text.flush()
}
