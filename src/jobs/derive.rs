//! Which pairs of links of a robot can touch: what is asked for, checked before any work, and
//! executed.

use std::ops::ControlFlow;
use std::time::Instant;

use super::request::{RequestError, check_request_id};
use crate::robot::Semantics;
use crate::robot::motion::{DeriveOptions, MotionProblemError};
use crate::scene::{DeriveProgress, DerivedLinks};
use crate::store::{DeriveOutcome, DeriveRequest, DerivedLinkPair, LoadedRobot};

/// Most boxes of joint values for one pair.
pub const MAX_DERIVE_BOXES: u32 = 10_000_000;

/// Checks what is known of a request without its robot, and its id.
///
/// # Errors
/// The first field that cannot be used.
pub fn check_derive(request_id: &str, request: &DeriveRequest) -> Result<(), RequestError> {
    check_request_id(request_id)?;
    let DeriveRequest { margin_m, max_boxes, resolution_m, .. } = *request;
    if !margin_m.is_finite() {
        return Err(RequestError::new("margin_m", format!("is {margin_m}; send a finite length in metres")));
    }
    if !(1..=MAX_DERIVE_BOXES).contains(&max_boxes) {
        let why = format!("is {max_boxes}; send 1 to {MAX_DERIVE_BOXES}, or leave it out");
        return Err(RequestError::new("max_boxes", why));
    }
    if !(resolution_m > 0.0 && resolution_m.is_finite()) {
        let why = format!("is {resolution_m}; send a positive finite length in metres, or leave it out");
        return Err(RequestError::new("resolution_m", why));
    }
    Ok(())
}

/// Executes a request about this robot. `progress` can end it; pairs that were not looked at are
/// undecided then.
///
/// # Errors
/// Links that make no problem.
pub fn derive(
    request: &DeriveRequest,
    loaded: &LoadedRobot,
    progress: &mut dyn FnMut(DeriveProgress) -> ControlFlow<()>,
) -> Result<DeriveOutcome, MotionProblemError> {
    let begun = Instant::now();
    let options = DeriveOptions { max_boxes: request.max_boxes, resolution_m: request.resolution_m };
    let derived = loaded.robot.derive_pairs(request.margin_m, &options, progress)?;
    let pairs = derived.into_iter().map(|derived| row(derived, loaded)).collect();
    Ok(DeriveOutcome { pairs, seconds: begun.elapsed().as_secs_f64() })
}

fn row(derived: DerivedLinks, loaded: &LoadedRobot) -> DerivedLinkPair {
    let DerivedLinks { links, pair, is_certain } = derived;
    let names = links.map(|link| loaded.robot.kinematics().links()[link].clone());
    let described = names.each_ref().map(|name| loaded.description.links.iter().position(|link| link.name == *name));
    let srdf_reason = match described {
        [Some(a), Some(b)] => reason(&loaded.semantics, a, b),
        _ => None,
    };
    DerivedLinkPair {
        links: names.map(|name| name.to_string()),
        class: pair.class,
        witness: pair.witness,
        upper_m: Some(pair.upper_m).filter(|upper| upper.is_finite()),
        is_certain,
        boxes: pair.boxes,
        srdf_reason,
    }
}

/// Why an SRDF disables two links, by their positions in the description.
fn reason(semantics: &Semantics, a: usize, b: usize) -> Option<String> {
    if !semantics.is_disabled(a, b) {
        return None;
    }
    let pair = (a.min(b), a.max(b));
    let listed = semantics.disabled_pairs.iter().find(|listed| (listed.first, listed.second) == pair);
    Some(listed.map(|listed| listed.reason.to_string()).unwrap_or_default())
}
