//! What a fit is asked for, checked before any work.

use std::path::Path;

use crate::body::{Solver, check_name};
use crate::fit::{
    Coordinates, EncloseError, EncloseOptions, FitError, FitOptions, MAX_PIECES, MAX_SETS, ReadError, ReadOptions,
    Reading, Scale, SosOptions, parse_mesh,
};
use crate::store::{FitGroup, FitMode, FitPolynomial, FitPreparation, FitRequest, FitSosBody, MAX_REQUEST_ID_BYTES};

/// Endings of the mesh formats that can be read.
pub use crate::fit::input::FORMATS as MESH_FORMATS;

/// Degree of bodies around groups unless another is asked for: multipliers make higher ones slow.
const GROUP_DEGREE: usize = 4;

/// A field of a request that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {why}")]
pub struct RequestError {
    /// Its name: of fits among the options of its mode or in [`FitRequest`], `group` for all
    /// options of a group together; of solves in the message that asks for one; or `request_id`.
    pub field: &'static str,
    /// The reason and the remedy.
    pub why: String,
}

impl RequestError {
    pub(super) fn new(field: &'static str, why: impl ToString) -> Self {
        let why = why.to_string();
        // Fits name their options themselves.
        let named = |words: &str| why.strip_prefix(words)?.strip_prefix(": ").map(str::to_owned);
        let words = if field == "c" { "relax convexity".to_owned() } else { field.replace('_', " ") };
        Self { field, why: named(&words).unwrap_or(why) }
    }
}

/// What the library is asked for.
pub(super) enum FitPlan {
    /// One body.
    Body(FitOptions),
    /// The rungs up to a degree.
    Ladder(FitOptions),
    /// What is near enough, metres.
    WithinGap(f64, FitOptions),
    /// A compound of at most so many parts.
    Compound(usize, FitOptions),
    /// A set that need not be convex.
    SosBody(SosOptions),
    /// Bodies around a group.
    Group(EncloseOptions),
}

/// Checks a request before any work, and its id.
///
/// # Errors
/// The first field that cannot be used.
pub fn check(request_id: &str, request: &FitRequest) -> Result<(), RequestError> {
    check_request_id(request_id)?;
    check_name(&request.name).map_err(|error| RequestError::new("name", error))?;
    if !request.input.is_empty() {
        check_name(&request.input).map_err(|error| RequestError::new("input", error))?;
    }
    check_positive("scale", request.scale, "; send a positive finite number or leave it out")?;
    check_preparation(request.mode.preparation())?;
    let checked = match plan(request) {
        FitPlan::Body(options) | FitPlan::Ladder(options) => options.check(&request.name),
        FitPlan::WithinGap(max_gap_m, options) => {
            check_positive("max_gap_m", max_gap_m, " m; send a positive finite length, or choose another mode")?;
            options.check(&request.name)
        }
        FitPlan::Compound(parts, options) => {
            if !(1..=MAX_PIECES).contains(&parts) {
                return Err(RequestError::new("parts", FitError::Parts(parts)));
            }
            options.check(&request.name)
        }
        FitPlan::SosBody(options) => options.check(&request.name),
        FitPlan::Group(options) => return check_group(request, &options),
    };
    checked.map_err(|error| RequestError::new(field_of(&error), error))
}

/// Checks what a client calls its request.
pub(super) fn check_request_id(request_id: &str) -> Result<(), RequestError> {
    if request_id.len() > MAX_REQUEST_ID_BYTES || request_id.chars().any(char::is_control) {
        let why = format!("must have at most {MAX_REQUEST_ID_BYTES} bytes and no control characters; send a UUID");
        return Err(RequestError::new("request_id", why));
    }
    Ok(())
}

fn check_positive(field: &'static str, value: f64, remedy: &str) -> Result<(), RequestError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(RequestError::new(field, format!("is {value}{remedy}")))
}

fn check_preparation(preparation: FitPreparation) -> Result<(), RequestError> {
    let FitPreparation { trim, min_thickness_m } = preparation;
    let thickness = min_thickness_m.unwrap_or(1.0);
    check_positive("min_thickness_m", thickness, "; send a positive finite number or leave it out")?;
    if (0.0..=0.5).contains(&trim) { Ok(()) } else { Err(RequestError::new("trim", FitError::Trim(trim))) }
}

/// The field that an error of the library is about.
fn field_of(error: &FitError) -> &'static str {
    match error {
        FitError::Degree(_) => "degree",
        FitError::Objective { .. } | FitError::RelaxedObjective(_) => "objective",
        FitError::Relaxation(_) => "c",
        FitError::Cone(_) => "cone",
        FitError::Solver => "solver",
        FitError::Slabs(_) => "slabs",
        _ => "name",
    }
}

fn check_group(request: &FitRequest, options: &EncloseOptions) -> Result<(), RequestError> {
    let group = asked_group(request)?;
    if request.solver == Some(Solver::Structured) {
        let why = "structured solves programs of points only; take clarabel, or leave the solver out";
        return Err(RequestError::new("solver", why));
    }
    if request.scale != 1.0 {
        let why = "is about stored bodies, which options of points do not change; leave out the scale";
        return Err(RequestError::new("group", why));
    }
    let count = group.body_ids.len();
    if count == 0 || (group.max_growth.is_none() && count > MAX_SETS) {
        let why = format!("has {count} bodies; name 1 to {MAX_SETS}, or more with a max growth, which makes several");
        return Err(RequestError::new("body_ids", why));
    }
    if let Some(growth) = group.max_growth.filter(|growth| !(*growth > 0.0 && growth.is_finite())) {
        return Err(RequestError::new("max_growth", EncloseError::Growth(growth)));
    }
    check_name(&body_name(request, count - 1)).map_err(|error| RequestError::new("name", error))?;
    options.check().map_err(|error| {
        let field = if matches!(error, EncloseError::MultiplierDegree(_)) { "multiplier_degree" } else { "degree" };
        RequestError::new(field, error)
    })
}

/// The group of a request about one.
pub(super) fn asked_group(request: &FitRequest) -> Result<&FitGroup, RequestError> {
    request.group().ok_or_else(|| RequestError::new("group", "is missing; name the bodies"))
}

/// Points, metres, and triangles of a mesh file in one of [`MESH_FORMATS`]; `input` names it in
/// errors, `scale` is metres per unit.
///
/// # Errors
/// What is wrong with the file, and where.
pub fn read_mesh(bytes: &[u8], format: &str, input: &str, scale: f64) -> Result<Reading, ReadError> {
    let name = if input.is_empty() { "the mesh" } else { input };
    let options = ReadOptions { scale: Scale::uniform(scale)?, ..ReadOptions::default() };
    parse_mesh(bytes, format, Path::new(name), &options)
}

/// How to execute a request.
pub(super) fn plan(request: &FitRequest) -> FitPlan {
    let default = FitOptions::default().degree;
    match &request.mode {
        FitMode::Body(body) => FitPlan::Body(convex(&body.polynomial, default, body.slabs, request)),
        FitMode::Ladder(ladder) => {
            let highest = ladder.polynomial.objective.max_degree();
            FitPlan::Ladder(convex(&ladder.polynomial, highest, ladder.slabs, request))
        }
        FitMode::WithinGap(within) => {
            let highest = within.polynomial.objective.max_degree();
            FitPlan::WithinGap(within.max_gap_m, convex(&within.polynomial, highest, 0, request))
        }
        FitMode::Compound(compound) => {
            FitPlan::Compound(compound.parts, convex(&compound.polynomial, default, compound.slabs, request))
        }
        FitMode::SosBody(FitSosBody { method, degree, raw_frame, .. }) => FitPlan::SosBody(SosOptions {
            degree: degree.unwrap_or(default),
            method: *method,
            coordinates: coordinates(*raw_frame),
            solver: request.solver,
            input: request.input.clone(),
        }),
        FitMode::Group(group) => FitPlan::Group(enclosing(group)),
    }
}

fn convex(polynomial: &FitPolynomial, default: usize, slabs: usize, request: &FitRequest) -> FitOptions {
    let FitPolynomial { degree, objective, cone, raw_frame, refine } = *polynomial;
    FitOptions {
        degree: degree.unwrap_or(default),
        objective,
        coordinates: coordinates(raw_frame),
        cone,
        refine,
        slabs,
        solver: request.solver,
        input: request.input.clone(),
        ..FitOptions::default()
    }
}

fn coordinates(raw_frame: bool) -> Coordinates {
    if raw_frame { Coordinates::Raw } else { Coordinates::Unit }
}

/// How to enclose a group.
pub(super) fn enclosing(group: &FitGroup) -> EncloseOptions {
    let options = EncloseOptions::new(group.degree.unwrap_or(GROUP_DEGREE));
    EncloseOptions { multiplier_degree: group.multiplier_degree.unwrap_or(options.multiplier_degree), ..options }
}

/// Name of a body that a request makes, counted from 0: its own, with a number where several share
/// it.
pub fn body_name(request: &FitRequest, index: usize) -> String {
    let name = &request.name;
    match request.group().and_then(|group| group.max_growth) {
        Some(_) => format!("{name}-{}", index + 1),
        None => name.clone(),
    }
}
