//! Between the messages of FitService and jobs.

use super::super::error::Invalid;
use super::super::proto::{
    self, FitHeader, FitJob, FitObjective, FitOptions, FitPhase, FitProgress, FitResult, FitState, MeshFormat,
};
use crate::jobs::{Phase, Progress, check};
use crate::store::{FitOptimum, FitOrder, FitOutcome, FittedBody, Job, JobState};

/// Objectives and their names in orders.
const OBJECTIVES: [(FitObjective, &str); 4] = [
    (FitObjective::LogdetP, "logdet-p"),
    (FitObjective::TraceP, "trace-p"),
    (FitObjective::LogdetH, "logdet-h"),
    (FitObjective::TraceH, "trace-h"),
];

/// Formats and the endings of their files.
const FORMATS: [(MeshFormat, &str); 5] = [
    (MeshFormat::Off, "off"),
    (MeshFormat::Obj, "obj"),
    (MeshFormat::Ply, "ply"),
    (MeshFormat::Stl, "stl"),
    (MeshFormat::Xyz, "xyz"),
];

pub(super) fn id(id: &str, field: &str) -> Result<u64, Invalid> {
    id.parse().map_err(|_| Invalid::new(field, "is no id of a fit job; give the one CreateFit returned"))
}

/// The request's id, the checked order, and the format of the mesh file that follows, if one does.
pub(super) fn order(header: FitHeader) -> Result<(String, FitOrder, Option<&'static str>), Invalid> {
    let format = header.mesh_format();
    if i32::from(format) != header.mesh_format {
        return Err(Invalid::new("header.mesh_format", "is no format this server knows"));
    }
    let options = header.options.unwrap_or_default();
    let objective = match options.objective() {
        known if i32::from(known) != options.objective => None,
        FitObjective::Unspecified => Some("logdet-p"),
        known => name_of(&OBJECTIVES, known),
    };
    let refused = |why| Invalid::new("header.options.objective", why);
    let order = FitOrder {
        name: header.name,
        input: header.input,
        degree: Some(number(options.degree)).filter(|&degree| degree != 0),
        objective: objective.ok_or_else(|| refused("is no objective this server knows"))?.to_owned(),
        refine: options.refine,
        slabs: number(options.slabs),
        ladder: options.ladder,
        max_gap_m: options.max_gap_m,
        trim: options.trim,
        min_thickness_m: options.min_thickness_m,
        scale: options.scale.unwrap_or(1.0),
    };
    check(&header.request_id, &order).map_err(|error| {
        let inside = if ["name", "input", "request_id"].contains(&error.field) { "" } else { "options." };
        Invalid::new(format!("header.{inside}{}", error.field), error.why)
    })?;
    Ok((header.request_id, order, name_of(&FORMATS, format)))
}

/// The header of an order for points that are sent in metres.
pub(super) fn header(order: &FitOrder) -> FitHeader {
    let FitOrder { name, input, .. } = order.clone();
    let mesh_format = MeshFormat::Unspecified.into();
    FitHeader { name, request_id: String::new(), input, mesh_format, options: Some(options(order)) }
}

pub(super) fn job(job: &Job, progress: Option<Progress>) -> FitJob {
    let Job { id, request_id, order, points, attempts, state, .. } = job;
    let (state, failure, result) = match state {
        JobState::Queued => (FitState::Queued, "", None),
        JobState::Running => (FitState::Running, "", None),
        JobState::Succeeded(outcome) => (FitState::Succeeded, "", Some(result(outcome))),
        JobState::Failed(why) => (FitState::Failed, why.as_str(), None),
        JobState::Cancelled => (FitState::Cancelled, "", None),
    };
    FitJob {
        id: id.to_string(),
        name: order.name.clone(),
        request_id: request_id.clone(),
        input: order.input.clone(),
        options: Some(options(order)),
        point_count: *points as u64,
        state: state.into(),
        attempts: *attempts,
        failure: failure.to_owned(),
        // The worker may not have told yet of the job it has begun, or of the one that was cancelled.
        progress: (state == FitState::Running).then(|| progress_message(progress.unwrap_or_default())),
        result,
    }
}

fn options(order: &FitOrder) -> FitOptions {
    let objective = OBJECTIVES.iter().find(|(_, name)| *name == order.objective);
    FitOptions {
        degree: super::super::wire::count(order.degree.unwrap_or(0)),
        objective: objective.map_or(FitObjective::Unspecified, |(objective, _)| *objective).into(),
        refine: order.refine,
        slabs: super::super::wire::count(order.slabs),
        ladder: order.ladder,
        max_gap_m: order.max_gap_m,
        trim: order.trim,
        min_thickness_m: order.min_thickness_m,
        scale: Some(order.scale),
    }
}

fn progress_message(progress: Progress) -> FitProgress {
    let phase = match progress.phase {
        Phase::Preparing => FitPhase::Preparing,
        Phase::Trimming => FitPhase::Trimming,
        Phase::Fitting => FitPhase::Fitting,
    };
    FitProgress {
        phase: phase.into(),
        rounds: progress.rounds,
        iterations: progress.iterations,
        gap: progress.gap,
        active_points: progress.active_points as u64,
    }
}

fn result(outcome: &FitOutcome) -> FitResult {
    let bodies =
        outcome.bodies.iter().map(|FittedBody { id, gap_m, mean_gap_m, seconds, optimum }| proto::FittedBody {
            body_id: id.clone(),
            gap_m: *gap_m,
            mean_gap_m: *mean_gap_m,
            duration_s: *seconds,
            optimum: optimum.as_ref().map(optimum_message),
        });
    FitResult { bodies: bodies.collect(), left_out_count: outcome.left_out as u64, left_out_m: outcome.left_out_m }
}

fn optimum_message(optimum: &FitOptimum) -> proto::FitOptimum {
    proto::FitOptimum {
        objective_value: optimum.objective_value,
        optimality_gap: optimum.optimality_gap,
        refinement_end: optimum.refinement_end.clone().unwrap_or_default(),
    }
}

fn name_of<T: PartialEq>(names: &[(T, &'static str)], wanted: T) -> Option<&'static str> {
    names.iter().find(|(known, _)| *known == wanted).map(|(_, name)| *name)
}

fn number(count: u32) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}
