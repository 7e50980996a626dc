//! What the arguments ask for, as a request: executed here or by a server, it makes the same.

use super::args::FitArgs;
use super::choice::Choice;
use crate::body::{Cone, Obstacle, SosMethod};
use crate::jobs::check;
use crate::store::{
    FitBody, FitCompound, FitGroup, FitLadder, FitMode, FitPolynomial, FitPreparation, FitRequest, FitSosBody,
    FitWithinGap,
};
use std::path::Path;

/// The request about one input, whose points are in metres when they are fitted; or the arguments
/// that exclude each other.
pub(super) fn request(args: &FitArgs, input: &Path, stem: &str) -> Result<FitRequest, String> {
    let input = input.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    Ok(FitRequest { input, solver: args.solver, ..FitRequest::new(stem, mode(args)?) })
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
    FitRequest { solver: args.solver, ..FitRequest::new(name, group) }
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
