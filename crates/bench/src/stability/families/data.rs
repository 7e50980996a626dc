//! Ill-conditioned data: 25.

use super::super::case::{Case, CaseError, Verdict};
use super::super::method::Method;
use super::super::zoo::e;
use super::{random, somewhere};
use nalgebra::{DMatrix, Matrix3, Vector3};
use sublevel::body::{Body, Constraint, Normalization};
use sublevel::measure::{Options, Pose};
use sublevel::polynomial::{HessianGram, Polynomial};

/// Kinds of data that are refused, or just not.
pub(super) const BAD: u64 = 22;

/// `{Σ x_i² + constant <= 1}` with a Gram matrix that is off by so much.
fn ball(constant: f64, off: f64) -> Result<bool, CaseError> {
    let mut terms = vec![([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0)];
    terms.push(([0, 0, 0], constant));
    let Ok(polynomial) = Polynomial::new(terms) else { return Ok(false) };
    let mut matrix = DMatrix::identity(3, 3) * 2.0;
    matrix[(0, 0)] += off;
    let gram = HessianGram::new(HessianGram::full_basis(2), matrix);
    let gram = gram.map_err(CaseError::other)?;
    let normalization = Normalization { center: Vector3::zeros(), linear: Matrix3::identity() };
    Ok(Body::new("ball", normalization, vec![Constraint { polynomial, gram }]).is_ok())
}

/// Every other time data that must be refused, as long as there are some, else bodies that are all
/// but degenerate: those are refused, or served within a bracket that is true.
pub(super) fn ill_conditioned(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    let number = seed / 2;
    if seed.is_multiple_of(2) && number < BAD {
        return if method == Method::Cold { refused(number).map(Some) } else { Ok(None) };
    }
    match extreme(seed)? {
        Some(case) => case.put(method),
        None => Ok(method.is_ours().then_some(Verdict::Pass)),
    }
}

/// `{Σ c_i (linear x)_i² <= 1}`; none if it is refused.
fn ellipsoid(coefficients: [f64; 3], linear: Matrix3<f64>) -> Result<Option<Body>, CaseError> {
    let axis = |i: usize| std::array::from_fn(|j| if i == j { 2 } else { 0 });
    let Ok(polynomial) = Polynomial::new((0..3).map(|i| (axis(i), coefficients[i])).collect()) else { return Ok(None) };
    let matrix = DMatrix::from_fn(3, 3, |i, j| if i == j { 2.0 * coefficients[i] } else { 0.0 });
    let gram = HessianGram::new(HessianGram::full_basis(2), matrix).map_err(CaseError::other)?;
    let normalization = Normalization { center: Vector3::zeros(), linear };
    Ok(Body::new("extreme", normalization, vec![Constraint { polynomial, gram }]).ok())
}

/// A body of radius 1e-8 m, of coefficients 1e±12, or of both, and an ordinary one near it.
fn extreme(draw: u64) -> Result<Option<Case>, CaseError> {
    let mut random = random(25, draw);
    let unit = Matrix3::identity();
    let body = match draw % 5 {
        0 => Body::ball("tiny", Vector3::zeros(), 1e-8).ok(),
        1 => ellipsoid([1e12; 3], unit)?,
        2 => ellipsoid([1e-12; 3], unit)?,
        3 => ellipsoid([1e12, 1.0, 1e-12], unit)?,
        _ => ellipsoid([1.0; 3], Matrix3::from_diagonal(&Vector3::new(1e8, 1.0, 1e-4)))?,
    };
    let Some(body) = body else { return Ok(None) };
    let reach = 2.0 * random.positive() + 1.5 * body.circumscribed().radius;
    let (pose_a, pose_b) = (somewhere(&mut random, 0.1)?, somewhere(&mut random, reach)?);
    let case = Case::new(&body, pose_a, &e(1.0, 0.5, 0.7)?, pose_b, "extreme".into());
    // A bracket below the rounding floor of the larger body may stay wide, and says so.
    let floor = 1e-12 * case.large();
    Ok(Some(Case { floor: if floor > case.accuracy * case.small() { floor } else { 0.0 }, ..case }))
}

/// What is refused, and beside it what is not.
fn refused(seed: u64) -> Result<Verdict, CaseError> {
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
        15 => (Body::ball("small", none, 1e-8).is_ok(), true),
        16 => (Body::ball("bad", none, f64::INFINITY).is_ok() || Body::ball("bad", none, -1.0).is_ok(), false),
        17 => (Body::ball("bad", Vector3::new(f64::NAN, 0.0, 0.0), 1.0).is_ok(), false),
        18 => (Body::cylinder("bad", 1.0, f64::NAN).is_ok() || Body::cylinder("bad", 0.0, 1.0).is_ok(), false),
        19 => (Pose::from_quaternion(Vector3::new(0.0, f64::NAN, 0.0), [0.0, 0.0, 0.0, 1.0]).is_ok(), false),
        20 => (matrix(Matrix3::repeat(f64::NAN)) || matrix(Matrix3::identity() * 1.01), false),
        // A Gram matrix that is off by no more than its least eigenvalue pays for.
        _ => (ball(0.0, 1.0)?, true),
    };
    let what = if accepted { "taken" } else { "refused" };
    Ok(if accepted == expected { Verdict::Pass } else { Verdict::WrongStatus(format!("number {seed} is {what}")) })
}
