//! Bad data: 25, 26.

use super::super::case::{CaseError, Verdict};
use super::super::method::Method;
use super::random;
use crate::body::{Body, Constraint, Normalization};
use crate::fit::{FitError, FitOptions, HullError, fit};
use crate::measure::{Options, Pose};
use crate::polynomial::{HessianGram, Polynomial};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::ops::ControlFlow;

/// Kinds of bad data.
pub(super) const BAD: u64 = 16;

/// `{Σ x_i² + constant <= 1}` with a Gram matrix that is off by so much.
fn ball(constant: f64, off: f64) -> Result<bool, CaseError> {
    let mut terms = vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)];
    terms.push(([0, 0, 0], constant));
    let Ok(polynomial) = Polynomial::new(terms) else { return Ok(false) };
    let mut matrix = DMatrix::identity(3, 3) * 2.0;
    matrix[(0, 0)] += off;
    let gram = HessianGram::new(HessianGram::full_basis(2), matrix);
    let gram = gram.map_err(|error| CaseError::Other(error.to_string()))?;
    let normalization = Normalization { center: Vector3::zeros(), linear: Matrix3::identity() };
    Ok(Body::new("ball", normalization, vec![Constraint { polynomial, gram }]).is_ok())
}

/// What is refused, and beside it what is not.
pub(super) fn refused(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if method != Method::Cold {
        return Ok(None);
    }
    let none = Vector3::zeros();
    let quaternion = |q: [f64; 4]| Pose::from_quaternion(none, q).is_ok();
    let matrix = |m: Matrix3<f64>| Pose::from_matrix(&m, none).is_ok();
    let (accepted, expected) = match seed {
        0 => (ball(1.0 - 1e-12, 0.0)?, false),
        1 => (ball(0.0, -1.0)?, false),
        2 => (ball(0.0, 3.0)?, false),
        3 => (ball(f64::NAN, 0.0)?, false),
        4 => (ball(0.0, 1e-3)?, true),
        5 => (ball(0.0, 0.0)?, true),
        6 => (Body::ball("bad", none, f64::NAN).is_ok() || Body::ball("bad", none, 0.0).is_ok(), false),
        7 => (Body::cuboid("bad", Vector3::new(1.0, -1.0, 1.0)).is_ok(), false),
        8 => (quaternion([f64::NAN, 0.0, 0.0, 1.0]) || quaternion([f64::INFINITY, 0.0, 0.0, 0.0]), false),
        9 => (quaternion([0.0; 4]) || quaternion([0.0, 0.0, 0.0, 1.001]), false),
        10 => (matrix(Matrix3::new(1.0, 1e-3, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)), false),
        11 => (matrix(-Matrix3::identity()) || matrix(Matrix3::zeros()), false),
        12 => (matrix(Matrix3::identity() * (1.0 + 1e-7)), true),
        13 => {
            (Options::default().with_accuracy(0.0).is_ok() || Options::default().with_accuracy(f64::NAN).is_ok(), false)
        }
        14 => (Options::default().with_max_iterations(0).is_ok(), false),
        _ => (Body::ball("small", none, 1e-8).is_ok(), true),
    };
    let what = if accepted { "taken" } else { "refused" };
    Ok(Some(if accepted == expected {
        Verdict::Pass
    } else {
        Verdict::WrongStatus(format!("number {seed} is {what}"))
    }))
}

/// Flat, collinear, double, few, far, tiny and outlying points: a body that holds them all, or an error that names the reason.
pub(super) fn clouds(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if method != Method::Cold {
        return Ok(None);
    }
    let mut random = random(26, seed);
    let count = 20 + random.index(300);
    let mut points: Vec<Vector3<f64>> = (0..count).map(|_| random.direction()).collect();
    let n = random.direction();
    let must_fail = match seed % 10 {
        0 => {
            points.iter_mut().for_each(|x| *x -= n * n.dot(x));
            true
        }
        1 => {
            points.iter_mut().for_each(|x| *x -= n * (n.dot(x) * (1.0 - 1e-4)));
            false
        }
        2 => {
            points.iter_mut().for_each(|x| *x = n * n.dot(x));
            true
        }
        3 => {
            let few = points[..6].to_vec();
            points.iter_mut().for_each(|x| *x = few[random.index(6)]);
            false
        }
        4 => {
            points.truncate(3);
            true
        }
        5 => {
            points.iter_mut().for_each(|x| *x += n * 1e5);
            false
        }
        6 => {
            let scale = random.between(1e-6, 1e6);
            points.iter_mut().for_each(|x| *x *= scale);
            false
        }
        7 => {
            points[0] *= random.between(10.0, 1e5);
            false
        }
        8 => {
            points = (0..8_u8).map(|i| Vector3::from_fn(|k, _| f64::from(i >> k & 1))).collect();
            false
        }
        _ => {
            points.iter_mut().for_each(|x| *x = x.component_mul(&Vector3::new(1.0, 1e-4, 3e-4)));
            false
        }
    };
    let degree = [2, 4, 6][(seed / 10 % 3) as usize];
    let options = FitOptions { degree, ..FitOptions::default() };
    Ok(Some(match fit("cloud", &points, &options, &mut |_| ControlFlow::Continue(())) {
        Ok(made) if made.body.prove_contains(&points).is_err() => Verdict::WrongStatus("a point is outside".into()),
        Ok(_) if must_fail => Verdict::WrongStatus("points without a hull were fitted".into()),
        Ok(_) => Verdict::Pass,
        Err(FitError::TooFewPoints(_) | FitError::Hull(HullError::Flat { .. })) if must_fail => Verdict::Pass,
        Err(error) => Verdict::WrongStatus(error.to_string()),
    }))
}
