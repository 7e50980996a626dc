//! Between the messages of CreateFit and requests.

use super::super::error::Invalid;
use super::super::limits::MAX_GROUP_BODIES;
use super::super::proto::fit_options::Mode;
use super::super::proto::fit_sos_body::Method;
use super::super::proto::{
    self, CreateFitRequest, FitCone, FitInverseMoment, FitObjective, FitOptions, FitRelaxed, FitSolver, MeshFormat,
};
use super::super::wire::{body_id, count};
use crate::body::{Cone, Objective, Solver, SosMethod};
use crate::jobs::{RequestError, check};
use crate::store::{
    FitBody, FitCompound, FitGroup, FitLadder, FitMode, FitPolynomial, FitPreparation, FitRequest, FitSosBody,
    FitWithinGap,
};

/// Where the options are in a CreateFit call.
const OPTIONS: &str = "options";

/// Objectives of messages and of requests.
const OBJECTIVES: [(FitObjective, Objective); 4] = [
    (FitObjective::LogdetP, Objective::LogDetP),
    (FitObjective::TraceP, Objective::TraceP),
    (FitObjective::LogdetH, Objective::LogDetH),
    (FitObjective::TraceH, Objective::TraceH),
];

/// Cones of messages and of requests.
const CONES: [(FitCone, Cone); 3] =
    [(FitCone::Sos, Cone::Sos), (FitCone::Sdsos, Cone::Sdsos), (FitCone::Dsos, Cone::Dsos)];

/// Formats and the endings of their files.
const FORMATS: [(MeshFormat, &str); 6] = [
    (MeshFormat::Off, "off"),
    (MeshFormat::Obj, "obj"),
    (MeshFormat::Ply, "ply"),
    (MeshFormat::Stl, "stl"),
    (MeshFormat::Xyz, "xyz"),
    (MeshFormat::Dae, "dae"),
];

/// Solvers of messages and of requests; the unspecified one leaves the choice open.
const SOLVERS: [(FitSolver, Option<Solver>); 2] =
    [(FitSolver::Clarabel, Some(Solver::Clarabel)), (FitSolver::Structured, Some(Solver::Structured))];

/// What solves a fit, of a number in a message.
pub(super) fn read_solver(solver: i32, field: &str) -> Result<Option<Solver>, Invalid> {
    known(&SOLVERS, solver, FitSolver::Unspecified, field)
}

/// The number in a message of what solves a fit.
pub(super) fn solver_message(solver: Option<Solver>) -> FitSolver {
    let known = SOLVERS.iter().find(|(_, known)| *known == solver);
    known.map_or(FitSolver::Unspecified, |(message, _)| *message)
}

/// The request's id, and the checked request.
pub(super) fn request(message: CreateFitRequest) -> Result<(String, FitRequest), Invalid> {
    let FitOptions { scale, trim, min_thickness_m, mode, solver } = message.options.unwrap_or_default();
    let preparation = FitPreparation { trim, min_thickness_m };
    let mode = read_mode(mode.unwrap_or_default(), preparation)?;
    let solver = read_solver(solver, "options.solver")?;
    let request = FitRequest { name: message.name, input: message.input, scale: scale.unwrap_or(1.0), mode, solver };
    check(&message.request_id, &request).map_err(|error| refused(&request.mode, error))?;
    Ok((message.request_id, request))
}

/// Format of a mesh file, by its ending; `field` is where the request has its number.
pub(in crate::service) fn format(number: i32, field: &str) -> Result<&'static str, Invalid> {
    let known = FORMATS.iter().find(|(known, _)| i32::from(*known) == number);
    known.map(|(_, ending)| *ending).ok_or_else(|| Invalid::new(field, "is no format this server knows"))
}

/// A field of a request as the path of the message's field.
fn refused(mode: &FitMode, RequestError { field, why }: RequestError) -> Invalid {
    let path = match (field, mode) {
        ("request_id" | "name" | "input", _) => field.to_owned(),
        ("scale" | "trim" | "min_thickness_m" | "group" | "solver", _) => format!("{OPTIONS}.{field}"),
        ("c" | "objective", FitMode::SosBody(_)) => format!("{OPTIONS}.sos_body.relaxed.{field}"),
        _ => format!("{OPTIONS}.{}.{field}", mode.name()),
    };
    Invalid::new(path, why)
}

fn read_mode(mode: Mode, preparation: FitPreparation) -> Result<FitMode, Invalid> {
    let is_prepared = preparation != FitPreparation::default();
    Ok(match mode {
        Mode::Body(proto::FitBody { degree, objective, cone, raw_frame, refine, slabs }) => {
            let polynomial = polynomial("body", (degree, objective, cone, raw_frame, refine))?;
            FitBody { polynomial, slabs: number(slabs), preparation }.into()
        }
        Mode::Ladder(proto::FitLadder { degree, objective, cone, raw_frame, refine, slabs }) => {
            let polynomial = polynomial("ladder", (degree, objective, cone, raw_frame, refine))?;
            FitLadder { polynomial, slabs: number(slabs), preparation }.into()
        }
        Mode::WithinGap(proto::FitWithinGap { max_gap_m, degree, objective, cone, raw_frame, refine }) => {
            let polynomial = polynomial("within_gap", (degree, objective, cone, raw_frame, refine))?;
            FitWithinGap { max_gap_m, polynomial, preparation }.into()
        }
        Mode::Compound(_) if is_prepared => {
            let why = "cut the mesh as it is; leave out trim and min_thickness_m, or choose another mode";
            return Err(Invalid::new(format!("{OPTIONS}.compound.parts"), why));
        }
        Mode::Compound(proto::FitCompound { parts, degree, objective, cone, raw_frame, refine, slabs }) => {
            let polynomial = polynomial("compound", (degree, objective, cone, raw_frame, refine))?;
            FitCompound { parts: number(parts), polynomial, slabs: number(slabs) }.into()
        }
        Mode::SosBody(message) => read_sos_body(message, preparation)?.into(),
        Mode::Group(_) if is_prepared => {
            let why =
                "is about stored bodies, which options of points do not change; leave out trim and min_thickness_m";
            return Err(Invalid::new(format!("{OPTIONS}.group"), why));
        }
        Mode::Group(message) => read_group(message)?.into(),
    })
}

/// Degree, objective, cone, raw frame and refinement of a message.
type Numbers = (Option<u32>, i32, i32, bool, bool);

fn polynomial(mode: &str, (degree, objective, cone, raw_frame, refine): Numbers) -> Result<FitPolynomial, Invalid> {
    Ok(FitPolynomial {
        degree: degree.map(number),
        objective: read_objective(objective, mode)?,
        cone: known(&CONES, cone, FitCone::Unspecified, &format!("{OPTIONS}.{mode}.cone"))?,
        raw_frame,
        refine,
    })
}

fn read_sos_body(message: proto::FitSosBody, preparation: FitPreparation) -> Result<FitSosBody, Invalid> {
    let proto::FitSosBody { degree, raw_frame, method } = message;
    let method = match method {
        Some(Method::Relaxed(FitRelaxed { c, objective })) => {
            SosMethod::Relaxed { c, objective: read_objective(objective, "sos_body.relaxed")? }
        }
        Some(Method::InverseMoment(FitInverseMoment {})) => SosMethod::InverseMoment,
        None => {
            let why = "names no method; send `relaxed` with its c, or `inverse_moment`";
            return Err(Invalid::new(format!("{OPTIONS}.sos_body"), why));
        }
    };
    Ok(FitSosBody { method, degree: degree.map(number), raw_frame, preparation })
}

fn read_group(message: proto::FitGroup) -> Result<FitGroup, Invalid> {
    let proto::FitGroup { body_ids, max_growth, multiplier_degree, degree } = message;
    let field = format!("{OPTIONS}.group.body_ids");
    if body_ids.len() > MAX_GROUP_BODIES {
        let why = format!(
            "has {} bodies; group at most {MAX_GROUP_BODIES} at once, such as those near each other",
            body_ids.len()
        );
        return Err(Invalid::new(field, why));
    }
    let ids = body_ids.iter().enumerate().map(|(index, id)| body_id(id, &format!("{field}[{index}]")));
    let (multiplier_degree, degree) = (multiplier_degree.map(number), degree.map(number));
    Ok(FitGroup { body_ids: ids.collect::<Result<_, _>>()?, max_growth, multiplier_degree, degree })
}

fn read_objective(objective: i32, at: &str) -> Result<Objective, Invalid> {
    known(&OBJECTIVES, objective, FitObjective::Unspecified, &format!("{OPTIONS}.{at}.objective"))
}

/// What a number of an enumeration stands for; the default for the unspecified one.
fn known<M, T>(table: &[(M, T)], number: i32, unspecified: M, field: &str) -> Result<T, Invalid>
where
    M: Copy + Into<i32>,
    T: Copy + Default,
{
    if number == unspecified.into() {
        return Ok(T::default());
    }
    let found = table.iter().find(|(message, _)| (*message).into() == number).map(|(_, known)| *known);
    found.ok_or_else(|| Invalid::new(field, "is none that this server knows"))
}

/// The message of a request, without points.
pub(crate) fn message(request: &FitRequest) -> CreateFitRequest {
    let FitRequest { name, input, .. } = request.clone();
    CreateFitRequest { name, request_id: String::new(), input, options: Some(options(request)), source: None }
}

/// The options of a request, with what was left open.
pub(super) fn options(request: &FitRequest) -> FitOptions {
    let FitPreparation { trim, min_thickness_m } = request.mode.preparation();
    let scale = request.group().is_none().then_some(request.scale);
    let solver = solver_message(request.solver).into();
    FitOptions { scale, trim, min_thickness_m, mode: Some(write_mode(&request.mode)), solver }
}

fn write_mode(mode: &FitMode) -> Mode {
    match mode {
        FitMode::Body(FitBody { polynomial, slabs, .. }) => {
            let (degree, objective, cone, raw_frame, refine) = numbers(polynomial);
            Mode::Body(proto::FitBody { degree, objective, cone, raw_frame, refine, slabs: count(*slabs) })
        }
        FitMode::Ladder(FitLadder { polynomial, slabs, .. }) => {
            let (degree, objective, cone, raw_frame, refine) = numbers(polynomial);
            Mode::Ladder(proto::FitLadder { degree, objective, cone, raw_frame, refine, slabs: count(*slabs) })
        }
        FitMode::WithinGap(FitWithinGap { max_gap_m, polynomial, .. }) => {
            let (degree, objective, cone, raw_frame, refine) = numbers(polynomial);
            Mode::WithinGap(proto::FitWithinGap { max_gap_m: *max_gap_m, degree, objective, cone, raw_frame, refine })
        }
        FitMode::Compound(FitCompound { parts, polynomial, slabs }) => {
            let (degree, objective, cone, raw_frame, refine) = numbers(polynomial);
            let (parts, slabs) = (count(*parts), count(*slabs));
            Mode::Compound(proto::FitCompound { parts, degree, objective, cone, raw_frame, refine, slabs })
        }
        FitMode::SosBody(set) => Mode::SosBody(write_sos_body(set)),
        FitMode::Group(group) => Mode::Group(write_group(group)),
    }
}

fn write_sos_body(set: &FitSosBody) -> proto::FitSosBody {
    let FitSosBody { method, degree, raw_frame, .. } = *set;
    let method = match method {
        SosMethod::Relaxed { c, objective } => {
            Method::Relaxed(FitRelaxed { c, objective: number_of(&OBJECTIVES, objective) })
        }
        SosMethod::InverseMoment => Method::InverseMoment(FitInverseMoment {}),
    };
    proto::FitSosBody { degree: degree.map(count), raw_frame, method: Some(method) }
}

fn write_group(group: &FitGroup) -> proto::FitGroup {
    let FitGroup { body_ids, max_growth, multiplier_degree, degree } = group;
    proto::FitGroup {
        body_ids: body_ids.iter().map(ToString::to_string).collect(),
        max_growth: *max_growth,
        multiplier_degree: multiplier_degree.map(count),
        degree: degree.map(count),
    }
}

fn numbers(polynomial: &FitPolynomial) -> Numbers {
    let FitPolynomial { degree, objective, cone, raw_frame, refine } = *polynomial;
    (degree.map(count), number_of(&OBJECTIVES, objective), number_of(&CONES, cone), raw_frame, refine)
}

/// The number of an enumeration that stands for this; 0 for what it does not have.
fn number_of<M: Copy + Into<i32>, T: PartialEq>(table: &[(M, T)], wanted: T) -> i32 {
    table.iter().find(|(_, known)| *known == wanted).map_or(0, |(message, _)| (*message).into())
}

fn number(count: u32) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}

impl Default for Mode {
    fn default() -> Self {
        Self::Body(proto::FitBody::default())
    }
}

#[cfg(test)]
mod tests;
