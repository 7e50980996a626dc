//! What the arguments ask for, as an order: carried out here or by a server, it makes the same.

use super::FitArgs;
use crate::body::Obstacle;
use crate::fit::{Objective, SosMethod, UnknownObjective};
use crate::jobs::check;
use crate::store::{FitGroup, FitOrder};
use std::fmt;
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

/// The order of one input, whose points are in metres when they are fitted.
pub(super) fn order(args: &FitArgs, input: &Path, stem: &str) -> FitOrder {
    FitOrder {
        name: stem.to_owned(),
        input: input.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
        degree: args.degree,
        objective: args.objective.to_string(),
        cone: args.cone.to_string(),
        raw_frame: args.raw_frame,
        relax_convexity: args.relax_convexity,
        refine: args.refine,
        slabs: args.slabs,
        ladder: args.ladder,
        max_gap_m: args.max_gap,
        parts: args.parts,
        trim: args.trim,
        min_thickness_m: args.min_thickness,
        ..FitOrder::default()
    }
}

/// The order of `--group`.
pub(in crate::cli) fn order_of_group(args: &FitArgs, name: &str, obstacles: &[Obstacle]) -> FitOrder {
    let group = FitGroup {
        body_ids: obstacles.iter().map(|obstacle| obstacle.id().to_string()).collect(),
        max_growth: args.max_growth,
        multiplier_degree: args.multiplier_degree,
    };
    FitOrder { name: name.to_owned(), degree: args.degree, group: Some(group), ..FitOrder::default() }
}

/// An order that can be carried out, or the argument that cannot be used, and why.
pub(in crate::cli) fn checked(order: FitOrder) -> Result<FitOrder, String> {
    check("", &order).map_err(|error| match error.field {
        "name" | "input" | "group.body_ids" => error.why,
        field => {
            let argument = field.trim_start_matches("group.").trim_end_matches("_m").replace('_', "-");
            format!("--{argument}: {}", error.why)
        }
    })?;
    Ok(order)
}

/// A length with its unit, or in metres.
pub(super) fn length(text: &str) -> Result<f64, String> {
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("", 1.0)];
    units
        .into_iter()
        .find_map(|(unit, metres)| Some(text.strip_suffix(unit)?.trim_end().parse::<f64>().ok()? * metres))
        .filter(|length| *length > 0.0 && length.is_finite())
        .ok_or_else(|| "not a positive length such as 5mm, 2cm or 0.005 (metres)".to_owned())
}

#[cfg(test)]
mod tests {
    use super::length;

    #[test]
    fn lengths_have_units_or_are_metres() {
        for (text, metres) in [("5mm", 5e-3), ("2 cm", 2e-2), ("0.5m", 0.5), ("3e-3", 3e-3), ("1e3mm", 1.0)] {
            assert!((length(text).unwrap() - metres).abs() < 1e-15, "{text}");
        }
        for text in ["", "mm", "5in", "-1mm", "0", "nan", "inf", "5 5mm"] {
            assert!(length(text).is_err(), "{text}");
        }
    }
}
