//! What a job is asked for, checked before any work.

use std::path::Path;

use super::execute::body_name;
use crate::body::check_name;
use crate::fit::{
    Cone, Coordinates, EncloseError, EncloseOptions, FitError, FitOptions, MAX_PIECES, MAX_SETS, Objective, ReadError,
    ReadOptions, Reading, Scale, SosMethod, SosOptions, parse_mesh,
};
use crate::store::{FitGroup, FitOrder, MAX_REQUEST_ID_BYTES};

/// Endings of the mesh formats that can be read.
pub use crate::fit::input::FORMATS as MESH_FORMATS;

/// Degree of bodies around groups unless another is asked for: multipliers make higher ones slow.
const GROUP_DEGREE: usize = 4;

/// A field of an order that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {why}")]
pub struct OrderError {
    /// Its name in [`FitOrder`], or `request_id`.
    pub field: &'static str,
    /// The reason and the remedy.
    pub why: String,
}

impl OrderError {
    pub(super) fn new(field: &'static str, why: impl ToString) -> Self {
        let why = why.to_string();
        // Fits name their options themselves.
        let words = field.trim_start_matches("group.").replace('_', " ");
        let why = why.strip_prefix(&words).and_then(|why| why.strip_prefix(": ")).unwrap_or(&why).to_owned();
        Self { field, why }
    }
}

/// How points become what is asked for.
pub(super) enum FitPlan {
    /// Bodies, or a compound of some.
    Convex(FitOptions),
    /// A set that need not be convex.
    Relaxed(SosOptions),
}

/// Checks an order before any work, and the request's id.
///
/// # Errors
/// The first field that cannot be used.
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
        return Err(OrderError::new("trim", FitError::Trim(order.trim)));
    }
    if let Some(group) = &order.group {
        return check_group(order, group);
    }
    let checked = match plan(order)? {
        FitPlan::Convex(options) => {
            check_parts(order)?;
            options.check(&order.name)
        }
        FitPlan::Relaxed(options) => {
            if order.refine || order.ladder || order.slabs > 0 || order.max_gap_m.is_some() || order.parts.is_some() {
                return Err(unfit(order, "refinement, ladder, slabs, parts and max gap need convex bodies"));
            }
            if order.cone != Cone::default().name() {
                return Err(unfit(order, "the cones sdsos and dsos make convex bodies"));
            }
            options.check(&order.name)
        }
    };
    checked.map_err(|error| {
        let field = match error {
            FitError::Degree(_) => "degree",
            FitError::Objective { .. } | FitError::RelaxedObjective(_) => "objective",
            FitError::Relaxation(_) => "relax_convexity",
            FitError::Cone(_) => "cone",
            FitError::Slabs(_) => "slabs",
            _ => "name",
        };
        OrderError::new(field, error)
    })
}

/// What does not go with a set that need not be convex.
fn unfit(order: &FitOrder, why: &str) -> OrderError {
    let field = if order.relax_convexity == 0.0 { "objective" } else { "relax_convexity" };
    OrderError::new(field, format!("{why}; leave them out, or relaxed convexity and inverse-moment"))
}

fn check_parts(order: &FitOrder) -> Result<(), OrderError> {
    if order.max_gap_m.is_some() && (order.ladder || order.slabs > 0 || order.parts.is_some()) {
        let why = "chooses degree, slabs and parts itself; leave out ladder, slabs and parts";
        return Err(OrderError::new("max_gap_m", why));
    }
    match order.parts {
        Some(parts) if !(1..=MAX_PIECES).contains(&parts) => Err(OrderError::new("parts", FitError::Parts(parts))),
        Some(_) if order.ladder || order.trim > 0.0 || order.min_thickness_m.is_some() => {
            Err(OrderError::new("parts", "cut the mesh as it is; leave out ladder, trimming and thickness, or parts"))
        }
        _ => Ok(()),
    }
}

fn check_group(order: &FitOrder, group: &FitGroup) -> Result<(), OrderError> {
    let FitOrder { name, input, degree, .. } = order.clone();
    if (FitOrder { group: None, ..order.clone() }) != (FitOrder { name, input, degree, ..FitOrder::default() }) {
        let why = "is about stored bodies, which options of points do not change; leave out all but the degree";
        return Err(OrderError::new("group", why));
    }
    let count = group.body_ids.len();
    if count == 0 || (group.max_growth.is_none() && count > MAX_SETS) {
        let why = format!("has {count} bodies; name 1 to {MAX_SETS}, or more with a max growth, which makes several");
        return Err(OrderError::new("group.body_ids", why));
    }
    if let Some(growth) = group.max_growth.filter(|growth| !(*growth > 0.0 && growth.is_finite())) {
        return Err(OrderError::new("group.max_growth", EncloseError::Growth(growth)));
    }
    check_name(&body_name(order, count - 1)).map_err(|error| OrderError::new("name", error))?;
    enclosing(order, group).check().map_err(|error| {
        let field =
            if matches!(error, EncloseError::MultiplierDegree(_)) { "group.multiplier_degree" } else { "degree" };
        OrderError::new(field, error)
    })
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

/// How to carry out an order about points.
pub(super) fn plan(order: &FitOrder) -> Result<FitPlan, OrderError> {
    let is_moment = order.objective == SosMethod::InverseMoment.name();
    if is_moment && order.relax_convexity != 0.0 {
        let why = "inverse-moment asks for no convexity; leave one of the two out";
        return Err(OrderError::new("relax_convexity", why));
    }
    let objective: Objective = match order.objective.parse() {
        Ok(objective) => objective,
        Err(_) if is_moment => Objective::default(),
        Err(error) => return Err(OrderError::new("objective", error)),
    };
    let cone: Cone = order.cone.parse().map_err(|error| OrderError::new("cone", error))?;
    let coordinates = if order.raw_frame { Coordinates::Raw } else { Coordinates::Unit };
    let input = order.input.clone();
    if order.is_relaxed() {
        let degree = order.degree.unwrap_or(FitOptions::default().degree);
        let c = order.relax_convexity;
        let method = if is_moment { SosMethod::InverseMoment } else { SosMethod::Relaxed { c, objective } };
        return Ok(FitPlan::Relaxed(SosOptions { degree, method, coordinates, input }));
    }
    let climbs = order.ladder || order.max_gap_m.is_some();
    Ok(FitPlan::Convex(FitOptions {
        degree: order.degree.unwrap_or(if climbs { objective.max_degree() } else { FitOptions::default().degree }),
        objective,
        coordinates,
        cone,
        refine: order.refine,
        slabs: order.slabs,
        input,
        ..FitOptions::default()
    }))
}

/// How to carry out an order about a group.
pub(super) fn enclosing(order: &FitOrder, group: &FitGroup) -> EncloseOptions {
    let options = EncloseOptions::new(order.degree.unwrap_or(GROUP_DEGREE));
    EncloseOptions { multiplier_degree: group.multiplier_degree.unwrap_or(options.multiplier_degree), ..options }
}
