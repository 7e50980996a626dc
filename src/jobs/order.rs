//! What a job is asked for, checked and carried out.

use std::ops::ControlFlow;
use std::path::Path;

use nalgebra::Vector3;

use super::Phase;
use crate::body::{Body, check_name};
use crate::fit::{
    self, FitError, FitOptions, Objective, Progress, ReadError, Rung, Trimmed, coarsest_within, ladder, thicken, trim,
};
use crate::store::{FitOptimum, FitOrder, FitOutcome, FittedBody, MAX_REQUEST_ID_BYTES};

/// Endings of the mesh formats that can be read.
pub use crate::fit::read::FORMATS as MESH_FORMATS;

/// A field of an order that can not be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {why}")]
pub struct OrderError {
    /// Its name in [`FitOrder`], or `request_id`.
    pub field: &'static str,
    /// The reason and the remedy.
    pub why: String,
}

impl OrderError {
    fn new(field: &'static str, why: impl ToString) -> Self {
        let why = why.to_string();
        // Fits name their options themselves.
        let why = why.strip_prefix(field).and_then(|why| why.strip_prefix(": ")).unwrap_or(&why).to_owned();
        Self { field, why }
    }
}

/// Checks an order before any work, and the request's id.
///
/// # Errors
/// The first field that can not be used.
pub fn check(request_id: &str, order: &FitOrder) -> Result<(), OrderError> {
    if request_id.len() > MAX_REQUEST_ID_BYTES || request_id.chars().any(char::is_control) {
        let why = format!("must have at most {MAX_REQUEST_ID_BYTES} bytes and no control characters; send a UUID");
        return Err(OrderError::new("request_id", why));
    }
    check_name(&order.name).map_err(|error| OrderError::new("name", error))?;
    if !order.input.is_empty() {
        check_name(&order.input).map_err(|error| OrderError::new("input", error))?;
    }
    for (field, value) in [
        ("max_gap_m", order.max_gap_m.unwrap_or(1.0)),
        ("min_thickness_m", order.min_thickness_m.unwrap_or(1.0)),
        ("scale", order.scale),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(OrderError::new(field, format!("is {value}; send a positive finite number or leave it out")));
        }
    }
    if !(0.0..=0.5).contains(&order.trim) {
        return Err(OrderError::new("trim", format!("is {}; send a fraction of 0 to 0.5, such as 0.01", order.trim)));
    }
    if order.max_gap_m.is_some() && (order.ladder || order.slabs > 0) {
        return Err(OrderError::new("max_gap_m", "chooses degree and slabs itself; leave out ladder and slabs"));
    }
    options(order)?.check(&order.name).map_err(|error| {
        let field = match error {
            FitError::Degree(_) => "degree",
            FitError::Objective { .. } => "objective",
            FitError::Slabs(_) => "slabs",
            _ => "name",
        };
        OrderError::new(field, error)
    })
}

/// The vertices of a mesh file in one of [`MESH_FORMATS`], metres; `input` names it in errors, `scale` is metres per unit.
///
/// # Errors
/// What is wrong with the file, and where.
pub fn read_mesh(bytes: &[u8], format: &str, input: &str, scale: f64) -> Result<Vec<Vector3<f64>>, ReadError> {
    let name = if input.is_empty() { "the mesh" } else { input };
    Ok(fit::read::parse(bytes, format, Path::new(name), scale)?.points)
}

/// Carries out an order. `progress` can stop it.
///
/// # Errors
/// As [`fit()`](fit::fit()).
pub(super) fn carry_out(
    order: &FitOrder,
    points: &[Vector3<f64>],
    mut progress: impl FnMut(Phase, Progress) -> ControlFlow<()>,
) -> Result<(FitOutcome, Vec<Body>), FitError> {
    let options = options(order).map_err(|_| FitError::Degree(0))?;
    let thick = order.min_thickness_m.map_or(points.into(), |least_m| thicken(points, least_m));
    let trimmed = if order.trim > 0.0 {
        trim(&thick, order.trim, &mut |said| progress(Phase::Trimming, said))?
    } else {
        Trimmed { kept: thick.into_owned(), left_out: Vec::new(), farthest_m: 0.0 }
    };
    let (name, points, mut tell) = (&order.name, &trimmed.kept, |said| progress(Phase::Fitting, said));
    let rungs = match order.max_gap_m {
        Some(max_gap_m) => vec![coarsest_within(name, points, max_gap_m, &options, &mut tell)?],
        None if order.ladder => ladder(name, points, &options, &mut tell)?,
        None => vec![fit::fit(name, points, &options, &mut tell)?.into()],
    };
    let bodies = rungs.iter().map(fitted).collect();
    let outcome = FitOutcome { bodies, left_out: trimmed.left_out.len(), left_out_m: trimmed.farthest_m };
    Ok((outcome, rungs.into_iter().map(|rung| rung.body).collect()))
}

fn fitted(Rung { body, gap, seconds, report }: &Rung) -> FittedBody {
    let optimum = report.as_ref().map(|report| FitOptimum {
        objective_value: report.objective_value,
        optimality_gap: report.optimality_gap,
        refinement_end: report.refinement_end.map(|end| end.to_string()),
    });
    FittedBody { id: body.id().to_string(), gap_m: gap.most_m, mean_gap_m: gap.mean_m, seconds: *seconds, optimum }
}

fn options(order: &FitOrder) -> Result<FitOptions, OrderError> {
    let objective: Objective = order.objective.parse().map_err(|error| OrderError::new("objective", error))?;
    let climbs = order.ladder || order.max_gap_m.is_some();
    Ok(FitOptions {
        degree: order.degree.unwrap_or(if climbs { objective.max_degree() } else { FitOptions::default().degree }),
        objective,
        refine: order.refine,
        slabs: order.slabs,
        input: order.input.clone(),
        ..FitOptions::default()
    })
}
