//! Degenerate point clouds: 26.

use super::super::case::{CaseError, Verdict};
use super::super::method::Method;
use super::random;
use crate::comparison::Random;
use nalgebra::Vector3;
use std::ops::ControlFlow;
use sublevel::body::Body;
use sublevel::fit::{Fit, FitError, FitOptions, HullError, fit};

/// Kinds of clouds; the last one, of a million points, is for full runs.
pub(super) const KINDS: u64 = 13;

/// Points of the largest clouds.
const MILLION: usize = 1_000_000;

/// What is to become of a cloud.
#[derive(Clone, Copy, PartialEq)]
enum Fate {
    /// A body that holds it.
    Fits,
    /// Refused as flat, in this shape.
    Flat(&'static str),
    /// Refused for so few points.
    TooFew,
    /// Refused where coordinates keep too few digits of the shape.
    TooFar,
}

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

/// Whether the body holds the points, and proves to be one when it is read back.
fn certified(made: &Fit, points: &[Vector3<f64>]) -> Verdict {
    if made.body.prove_contains(points).is_err() {
        return Verdict::WrongStatus("a point is outside".into());
    }
    match Body::from_json(&made.body.to_json()) {
        Ok(_) => Verdict::Pass,
        Err(error) => Verdict::WrongStatus(format!("not certified: {error}")),
    }
}

fn cloud(kind: u64, random: &mut Random) -> (Vec<Vector3<f64>>, Fate) {
    let count = 20 + random.index(300);
    let mut points: Vec<Vector3<f64>> = (0..count).map(|_| random.direction()).collect();
    let n = random.direction();
    let mut fate = Fate::Fits;
    match kind {
        0 => {
            points.iter_mut().for_each(|x| *x -= n * n.dot(x));
            fate = Fate::Flat("coplanar");
        }
        1 => points.iter_mut().for_each(|x| *x -= n * (n.dot(x) * (1.0 - 1e-4))),
        2 => {
            points.iter_mut().for_each(|x| *x = n * n.dot(x));
            fate = Fate::Flat("collinear");
        }
        3 => {
            let few = points[..6].to_vec();
            points.iter_mut().for_each(|x| *x = few[random.index(6)]);
        }
        4 => {
            points.truncate(3);
            fate = Fate::TooFew;
        }
        5 => points.iter_mut().for_each(|x| *x += n * 1e5),
        6 => {
            points.iter_mut().for_each(|x| *x += n * 1e14);
            fate = Fate::TooFar;
        }
        7 => {
            let scale = random.between(1e-6, 1e6);
            points.iter_mut().for_each(|x| *x *= scale);
        }
        8 => points[0] *= random.between(10.0, 1e5),
        9 => points = (0..8_u8).map(|i| Vector3::from_fn(|k, _| f64::from(i >> k & 1))).collect(),
        10 => points.iter_mut().for_each(|x| *x = x.component_mul(&Vector3::new(1.0, 1e-4, 3e-4))),
        11 => {
            points.fill(n);
            fate = Fate::Flat("coincident");
        }
        // In a box anywhere: most are inside of their hull.
        _ => {
            let (turn, sizes) = (random.rotation(), Vector3::from_fn(|_, _| random.between(0.1, 2.0)));
            let mut inside = || turn * Vector3::from_fn(|_, _| random.signed()).component_mul(&sizes) + n;
            points = (0..MILLION).map(|_| inside()).collect();
        }
    }
    (points, fate)
}
