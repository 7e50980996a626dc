//! Ill-conditioned data: 25.

use super::{Case, Draws};
use crate::bodies::{b, e, p};
use nalgebra::{DMatrix, Matrix3, UnitQuaternion, Vector3};
use std::fmt::Debug;
use sublevel_core::body::{Body, BodyError, Constraint, Normalization};
use sublevel_core::measure::{Options, Pose};
use sublevel_core::polynomial::{HessianGram, Polynomial};

/// Kinds of data that are refused, or just not.
pub const KINDS: u64 = 22;

/// Something to be refused or accepted, and what became of it.
#[derive(Clone, Debug)]
pub struct Attempt {
    pub what: String,
    /// The error as `Debug` prints it, where it was refused.
    pub refused: Option<String>,
    /// Whether it had to be refused, by what the printed error begins with; none if it had to be
    /// accepted.
    pub expected: Option<&'static str>,
}

impl Attempt {
    /// Whether it was refused, if at all, for the right reason.
    pub fn is_right(&self) -> bool {
        match (&self.refused, self.expected) {
            (None, None) => true,
            (Some(error), Some(reason)) => error.starts_with(reason),
            _ => false,
        }
    }
}

/// `expected` is empty where any reason will do.
pub(super) fn attempt<T, E: Debug>(what: impl Debug, made: Result<T, E>, expected: Option<&'static str>) -> Attempt {
    Attempt { what: format!("{what:?}"), refused: made.err().map(|error| format!("{error:?}")), expected }
}

/// What must not be accepted, and beside it what just is, by kind.
pub fn attempts(kind: u64) -> Vec<Attempt> {
    let none = Vector3::zeros();
    let any = Some("");
    let bad = "bad";
    let quaternions = |list: [[f64; 4]; 2]| list.map(|q| attempt(q, Pose::from_quaternion(none, q), any)).into();
    let matrices = |list: Vec<Matrix3<f64>>, expected| {
        list.into_iter().map(|m| attempt(m, Pose::from_matrix(&m, none), expected)).collect()
    };
    let radii = |radius: f64, expected| attempt(radius, Body::ball(bad, none, radius), expected);
    let unit = Matrix3::identity();
    match kind {
        // Too shallow to be distinguished from empty.
        0 => vec![ball("min p = 1 - 1e-12", 1.0 - 1e-12, 0.0, Some("Interior"))],
        1 => vec![ball("Gram matrix off by -1", 0.0, -1.0, any)],
        2 => vec![ball("Gram matrix off by 3", 0.0, 3.0, any)],
        3 => [[f64::NAN, 0.0], [1.0, f64::NAN], [f64::INFINITY, 0.0]]
            .map(|[coefficient, constant]| {
                attempt([coefficient, constant], square([coefficient, 1.0, 1.0], constant), Some("NotFinite"))
            })
            .into(),
        // The smallest eigenvalue absorbs a small residual, never for a gross one.
        4 => vec![ball("Gram matrix off by 1e-3", 0.0, 1e-3, None)],
        5 => vec![ball("a ball", 0.0, 0.0, None)],
        6 => [f64::NAN, 0.0].map(|radius| radii(radius, any)).into(),
        7 => [-1.0, f64::NAN, f64::INFINITY, 0.0]
            .map(|half| attempt(half, Body::cuboid(bad, Vector3::new(1.0, half, 1.0)), any))
            .into(),
        8 => quaternions([[f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY, 0.0, 0.0, 0.0]]),
        9 => quaternions([[0.0; 4], [0.0, 0.0, 0.0, 1.001]]),
        10 => matrices(vec![Matrix3::new(1.0, 1e-3, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)], any),
        11 => matrices(vec![-unit, Matrix3::zeros()], any),
        12 => matrices(vec![unit * (1.0 + 1e-7)], None),
        13 => [0.0, f64::NAN, f64::INFINITY, -1.0]
            .map(|accuracy| attempt(accuracy, Options::default().with_accuracy(accuracy), any))
            .into(),
        14 => vec![attempt("no iterations", Options::default().with_max_iterations(0), Some("Iterations(0)"))],
        15 => vec![radii(1e-8, None)],
        16 => [f64::INFINITY, -1.0].map(|radius| radii(radius, any)).into(),
        17 => {
            [f64::NAN, f64::INFINITY].map(|x| attempt(x, Body::ball(bad, Vector3::new(x, 0.0, 0.0), 1.0), any)).into()
        }
        18 => [[1.0, f64::NAN], [0.0, 1.0], [1.0, f64::INFINITY], [1.0, 0.0], [1.0, -1.0]]
            .map(|[radius, half]| attempt([radius, half], Body::cylinder(bad, radius, half), any))
            .into(),
        19 => {
            let place = Vector3::new(0.0, f64::NAN, 0.0);
            vec![attempt(place, Pose::from_quaternion(place, [0.0, 0.0, 0.0, 1.0]), Some("NotFinite"))]
        }
        20 => matrices(vec![Matrix3::repeat(f64::NAN), unit * 1.01], any),
        // A Gram matrix that is off by no more than its least eigenvalue absorbs.
        _ => vec![ball("Gram matrix off by 1", 0.0, 1.0, None)],
    }
}

/// `{Σ x_i² + constant <= 1}` with a Gram matrix that is off by so much.
fn ball(what: &str, constant: f64, off: f64, expected: Option<&'static str>) -> Attempt {
    let mut matrix = DMatrix::identity(3, 3) * 2.0;
    matrix[(0, 0)] += off;
    attempt(what, body_of([1.0; 3], constant, matrix, Matrix3::identity()), expected)
}

fn square(coefficients: [f64; 3], constant: f64) -> Result<Polynomial, sublevel_core::polynomial::PolynomialError> {
    let axis = |i: usize| std::array::from_fn(|j| if i == j { 2 } else { 0 });
    let mut terms: Vec<_> = (0..3).map(|i| (axis(i), coefficients[i])).collect();
    if constant != 0.0 {
        terms.push(([0, 0, 0], constant));
    }
    Polynomial::new(terms)
}

fn body_of(
    coefficients: [f64; 3],
    constant: f64,
    matrix: DMatrix<f64>,
    linear: Matrix3<f64>,
) -> Result<Body, BodyError> {
    let polynomial = square(coefficients, constant).expect("finite");
    let gram = HessianGram::new(HessianGram::full_basis(2), matrix).expect("well formed");
    let normalization = Normalization { center: Vector3::zeros(), linear };
    Body::new("extreme", normalization, vec![Constraint { polynomial, gram }])
}

/// Bodies of [`extreme`].
pub const EXTREMES: u64 = 5;

/// A body of radius 1e-8 m, of coefficients 1e±12, or of both, and an ordinary one near it: to be
/// served within a bracket that is true; none if the body is refused, which is as well.
pub fn extreme(kind: u64, random: &mut dyn Draws) -> Option<Case> {
    let ellipsoid = |coefficients: [f64; 3], linear: Matrix3<f64>| {
        let matrix = DMatrix::from_fn(3, 3, |i, j| if i == j { 2.0 * coefficients[i] } else { 0.0 });
        body_of(coefficients, 0.0, matrix, linear)
    };
    let unit = Matrix3::identity();
    let body = match kind {
        0 => Body::ball("tiny", Vector3::zeros(), 1e-8),
        1 => ellipsoid([1e12; 3], unit),
        2 => ellipsoid([1e-12; 3], unit),
        3 => ellipsoid([1e12, 1.0, 1e-12], unit),
        _ => ellipsoid([1.0; 3], Matrix3::from_diagonal(&Vector3::new(1e8, 1.0, 1e-4))),
    };
    let body = body.ok()?;
    let reach = 2.0 * random.positive() + 1.5 * body.circumscribed().radius;
    let (pose_a, pose_b) = (random.pose(0.1), random.pose(reach));
    let case = Case::new(&body, pose_a, &e(1.0, 0.5, 0.7), pose_b, "extreme");
    // A bracket below the rounding floor of the larger body may stay wide, and says so.
    let floor = 1e-12 * case.large();
    Some(Case { floor: if floor > case.accuracy * case.small() { floor } else { 0.0 }, ..case })
}

/// A matrix that is off a rotation by as much as is accepted: the deviation is removed, not carried
/// along.
pub fn nearly_orthonormal() -> Case {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.2, 0.1)).to_rotation_matrix().into_inner();
    let pose_a = Pose::from_matrix(&(turn * (1.0 + 1e-7)), Vector3::new(2.0, 0.0, 0.0)).expect("accepted");
    Case::new(&p(4, 0.5), pose_a, &b(0.3, 0.2, 0.4), Pose::identity(), "nearly orthonormal")
}
