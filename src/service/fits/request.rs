//! Between the headers of CreateFit and orders.

use super::super::error::Invalid;
use super::super::limits::MAX_GROUP_BODIES;
use super::super::proto::{FitCone, FitGroup, FitHeader, FitObjective, FitOptions, MeshFormat};
use super::super::wire::{body_id, count};
use crate::jobs::check;
use crate::store::{self, FitOrder};

/// Objectives and their names in orders.
const OBJECTIVES: [(FitObjective, &str); 5] = [
    (FitObjective::LogdetP, "logdet-p"),
    (FitObjective::TraceP, "trace-p"),
    (FitObjective::LogdetH, "logdet-h"),
    (FitObjective::TraceH, "trace-h"),
    (FitObjective::InverseMoment, "inverse-moment"),
];

/// Cones and their names in orders.
const CONES: [(FitCone, &str); 3] = [(FitCone::Sos, "sos"), (FitCone::Sdsos, "sdsos"), (FitCone::Dsos, "dsos")];

/// Formats and the endings of their files.
const FORMATS: [(MeshFormat, &str); 6] = [
    (MeshFormat::Off, "off"),
    (MeshFormat::Obj, "obj"),
    (MeshFormat::Ply, "ply"),
    (MeshFormat::Stl, "stl"),
    (MeshFormat::Xyz, "xyz"),
    (MeshFormat::Dae, "dae"),
];

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
    let cone = match options.cone() {
        known if i32::from(known) != options.cone => None,
        FitCone::Unspecified => Some("sos"),
        known => name_of(&CONES, known),
    };
    let unknown = |field: &str| Invalid::new(format!("header.options.{field}"), "is none that this server knows");
    let order = FitOrder {
        name: header.name,
        input: header.input,
        degree: given(options.degree),
        objective: objective.ok_or_else(|| unknown("objective"))?.to_owned(),
        cone: cone.ok_or_else(|| unknown("cone"))?.to_owned(),
        raw_frame: options.raw_frame,
        relax_convexity: options.relax_convexity,
        refine: options.refine,
        slabs: number(options.slabs),
        ladder: options.ladder,
        max_gap_m: options.max_gap_m,
        parts: given(options.parts),
        trim: options.trim,
        min_thickness_m: options.min_thickness_m,
        scale: options.scale.unwrap_or(1.0),
        group: options.group.map(group).transpose()?,
    };
    check(&header.request_id, &order).map_err(|error| {
        let inside = if ["name", "input", "request_id"].contains(&error.field) { "" } else { "options." };
        Invalid::new(format!("header.{inside}{}", error.field), error.why)
    })?;
    let format = name_of(&FORMATS, format);
    if order.group.is_some() && format.is_some() {
        let why = "announces a mesh file where the options name a group of stored bodies; leave out one of the two";
        return Err(Invalid::new("header.mesh_format", why));
    }
    Ok((header.request_id, order, format))
}

fn group(group: FitGroup) -> Result<store::FitGroup, Invalid> {
    let FitGroup { body_ids, max_growth, multiplier_degree } = group;
    let field = "header.options.group.body_ids";
    if body_ids.len() > MAX_GROUP_BODIES {
        let why = format!(
            "has {} bodies; group at most {MAX_GROUP_BODIES} at once, such as those near each other",
            body_ids.len()
        );
        return Err(Invalid::new(field, why));
    }
    for (index, id) in body_ids.iter().enumerate() {
        body_id(id, &format!("{field}[{index}]"))?;
    }
    Ok(store::FitGroup { body_ids, max_growth, multiplier_degree: multiplier_degree.map(number) })
}

/// The header of an order for points that are sent in metres, or for a group.
pub(super) fn header(order: &FitOrder) -> FitHeader {
    let FitOrder { name, input, .. } = order.clone();
    let mesh_format = MeshFormat::Unspecified.into();
    FitHeader { name, request_id: String::new(), input, mesh_format, options: Some(options(order)) }
}

pub(super) fn options(order: &FitOrder) -> FitOptions {
    let objective = OBJECTIVES.iter().find(|(_, name)| *name == order.objective);
    let cone = CONES.iter().find(|(_, name)| *name == order.cone);
    FitOptions {
        degree: count(order.degree.unwrap_or(0)),
        objective: objective.map_or(FitObjective::Unspecified, |(objective, _)| *objective).into(),
        refine: order.refine,
        slabs: count(order.slabs),
        ladder: order.ladder,
        max_gap_m: order.max_gap_m,
        trim: order.trim,
        min_thickness_m: order.min_thickness_m,
        scale: Some(order.scale),
        cone: cone.map_or(FitCone::Unspecified, |(cone, _)| *cone).into(),
        raw_frame: order.raw_frame,
        parts: count(order.parts.unwrap_or(0)),
        relax_convexity: order.relax_convexity,
        group: order.group.as_ref().map(|group| FitGroup {
            body_ids: group.body_ids.clone(),
            max_growth: group.max_growth,
            multiplier_degree: group.multiplier_degree.map(count),
        }),
    }
}

fn name_of<T: PartialEq>(names: &[(T, &'static str)], wanted: T) -> Option<&'static str> {
    names.iter().find(|(known, _)| *known == wanted).map(|(_, name)| *name)
}

/// None for 0, which stands for the default.
fn given(count: u32) -> Option<usize> {
    Some(number(count)).filter(|&count| count != 0)
}

fn number(count: u32) -> usize {
    usize::try_from(count).unwrap_or(usize::MAX)
}
