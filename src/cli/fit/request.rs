//! What the arguments ask for, as a request: executed here or by a server, it makes the same.

use super::FitArgs;
use crate::body::{Cone, Objective, Obstacle, SosMethod, UnknownObjective};
use crate::jobs::check;
use crate::store::{
    FitBody, FitCompound, FitGroup, FitLadder, FitMode, FitPolynomial, FitPreparation, FitRequest, FitSosBody,
    FitWithinGap,
};
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

/// The request about one input, whose points are in metres when they are fitted; or the arguments
/// that exclude each other.
pub(super) fn request(args: &FitArgs, input: &Path, stem: &str) -> Result<FitRequest, String> {
    let input = input.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(FitRequest { input, ..FitRequest::new(stem, mode(args)?) })
}

/// Arguments that need no check here exclude each other on the command line already.
fn mode(args: &FitArgs) -> Result<FitMode, String> {
    let preparation = FitPreparation { trim: args.trim, min_thickness_m: args.min_thickness };
    let objective = match (args.objective, args.relax_convexity) {
        (Choice::Minimise(objective), 0.0) => objective,
        (Choice::Minimise(objective), c) => {
            return sos_body(args, SosMethod::Relaxed { c, objective }, preparation);
        }
        (Choice::InverseMoment, 0.0) => return sos_body(args, SosMethod::InverseMoment, preparation),
        (Choice::InverseMoment, _) => {
            return Err("--relax-convexity: inverse-moment asks for no convexity; leave one of the two out".to_owned());
        }
    };
    let FitArgs { degree, cone, raw_frame, refine, slabs, .. } = *args;
    let polynomial = FitPolynomial { degree, objective, cone, raw_frame, refine };
    Ok(match (args.max_gap, args.parts) {
        (Some(max_gap_m), _) => FitWithinGap { max_gap_m, polynomial, preparation }.into(),
        (None, Some(parts)) => FitCompound { parts, polynomial, slabs }.into(),
        (None, None) if args.ladder => FitLadder { polynomial, slabs, preparation }.into(),
        (None, None) => FitBody { polynomial, slabs, preparation }.into(),
    })
}

fn sos_body(args: &FitArgs, method: SosMethod, preparation: FitPreparation) -> Result<FitMode, String> {
    let unfit = if args.refine || args.ladder || args.slabs > 0 || args.max_gap.is_some() || args.parts.is_some() {
        Some("refinement, ladder, slabs, parts and max gap need convex bodies")
    } else {
        (args.cone != Cone::default()).then_some("the cones sdsos and dsos make convex bodies")
    };
    match unfit {
        Some(why) => {
            let argument = if method == SosMethod::InverseMoment { "objective" } else { "relax-convexity" };
            Err(format!("--{argument}: {why}; leave them out, or relaxed convexity and inverse-moment"))
        }
        None => Ok(FitSosBody { method, degree: args.degree, raw_frame: args.raw_frame, preparation }.into()),
    }
}

/// The request of `--group`.
pub(in crate::cli) fn request_of_group(args: &FitArgs, name: &str, obstacles: &[Obstacle]) -> FitRequest {
    let group = FitGroup {
        body_ids: obstacles.iter().map(|obstacle| *obstacle.id()).collect(),
        max_growth: args.max_growth,
        multiplier_degree: args.multiplier_degree,
        degree: args.degree,
    };
    FitRequest::new(name, group)
}

/// A request that can be executed, or the argument that cannot be used, and why.
pub(in crate::cli) fn checked(request: FitRequest) -> Result<FitRequest, String> {
    check("", &request).map_err(|error| match error.field {
        "name" | "input" | "body_ids" => error.why,
        "c" => format!("--relax-convexity: {}", error.why),
        field => format!("--{}: {}", field.trim_end_matches("_m").replace('_', "-"), error.why),
    })?;
    Ok(request)
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
