//! Degenerate point clouds: 26.

use super::super::method::Method;
use super::super::question::{CaseError, Verdict};
use super::draws::random;
use nalgebra::Vector3;
use std::ops::ControlFlow;
use sublevel::body::Body;
use sublevel::fit::{Fit, FitError, FitOptions, HullError, fit};
use sublevel_testkit::catalogue::clouds::{Fate, KINDS, cloud};

/// Flat, collinear, double, few, many, far, tiny and outlying points: a certified body that holds
/// them all, or an error that names the reason.
pub(super) fn clouds(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if method != Method::Cold {
        return Ok(None);
    }
    let (points, fate) = cloud(seed % KINDS, &mut random(26, seed));
    let degree = [2, 4, 6][(seed / KINDS % 3) as usize];
    let options = FitOptions { degree, ..FitOptions::default() };
    let made = fit("cloud", &points, &options, &mut |_| ControlFlow::Continue(()));
    Ok(Some(match (fate, made) {
        (Fate::Fits, Ok(made)) => certified(&made, &points),
        (_, Ok(_)) => Verdict::WrongStatus("points without a body were fitted".into()),
        (Fate::Flat(shape), Err(FitError::Hull(HullError::Flat { shape: announce, .. }))) if announce == shape => {
            Verdict::Pass
        }
        (Fate::TooFew, Err(FitError::TooFewPoints(3)))
        | (Fate::TooFar, Err(FitError::Hull(HullError::TooFar { .. }))) => Verdict::Pass,
        (_, Err(error)) => Verdict::WrongStatus(error.to_string()),
    }))
}

/// Whether the body contains the points, and proves to be one when it is read back.
fn certified(made: &Fit, points: &[Vector3<f64>]) -> Verdict {
    if made.body.prove_contains(points).is_err() {
        return Verdict::WrongStatus("a point is outside".into());
    }
    match Body::from_json(&made.body.to_json()) {
        Ok(_) => Verdict::Pass,
        Err(error) => Verdict::WrongStatus(format!("not certified: {error}")),
    }
}
