//! The bodies of the catalogue: ellipsoids E, superellipsoids Q2k, rounded cylinders C2k, rounded
//! octahedral prisms P2k, boxes B, cylinders, and fitted ones F.

use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use sublevel::body::{Body, BodyError, Constraint, Normalization};
use sublevel::fit::{FitError, FitOptions, NoCertificate, certificate, fit};
use sublevel::polynomial::{Exponents, Polynomial, PolynomialError, degree_of, monomials};

/// Why a body of the catalogue is none.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum ZooError {
    /// Its numbers.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// Its polynomial.
    #[error(transparent)]
    Polynomial(#[from] PolynomialError),
    /// It has no certificate.
    #[error(transparent)]
    Certificate(#[from] NoCertificate),
    /// It cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
}

/// E: ellipsoid with these half-axes, metres.
pub(super) fn e(x: f64, y: f64, z: f64) -> Result<Body, ZooError> {
    Ok(Body::ellipsoid("E", Vector3::zeros(), Vector3::new(x, y, z))?)
}

/// Q2k: `(x/a)^degree + (y/b)^degree + (z/c)^degree <= 1`.
pub(super) fn q(degree: u8, x: f64, y: f64, z: f64) -> Result<Body, ZooError> {
    Ok(Body::superellipsoid(&format!("Q{degree}"), Vector3::zeros(), Vector3::new(x, y, z), degree)?)
}

/// C2k: `((x² + y²)/r²)^k + (z/h)^2k <= 1`, degree 2k.
pub(super) fn c(degree: u8, radius: f64, half_height: f64) -> Result<Body, ZooError> {
    let half = usize::from(degree / 2);
    let mut terms: Vec<_> = (0..=half).map(|i| ([2 * i as u8, 2 * (half - i) as u8, 0], binomial(half, i))).collect();
    terms.push(([0, 0, degree], 1.0));
    certified(&format!("C{degree}"), Vector3::new(radius, radius, half_height), Polynomial::new(terms)?)
}

/// P2k: `Σ (a_i·x/size)^degree <= 1` with the a_i along the axes and the diagonals of a cube.
pub(super) fn p(degree: u8, size: f64) -> Result<Body, ZooError> {
    let third = 1.0 / 3.0_f64.sqrt();
    let mut directions = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let diagonals = [[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [1.0, 1.0, -1.0]];
    directions.extend(diagonals.map(|d| d.map(|c| c * third)));
    let power = |a: &[f64; 3], e: Exponents| {
        let multinomial = factorial(degree_of(e)) / e.iter().map(|&k| factorial(usize::from(k))).product::<f64>();
        multinomial * (0..3).map(|i| a[i].powi(i32::from(e[i]))).product::<f64>()
    };
    let mut coefficients: BTreeMap<Exponents, f64> = BTreeMap::new();
    for e in monomials(usize::from(degree)).into_iter().filter(|&e| degree_of(e) == usize::from(degree)) {
        coefficients.insert(e, directions.iter().map(|a| power(a, e)).sum());
    }
    certified(&format!("P{degree}"), Vector3::repeat(size), Polynomial::new(coefficients.into_iter().collect())?)
}

/// B: box with these half-extents, metres.
pub(super) fn b(x: f64, y: f64, z: f64) -> Result<Body, ZooError> {
    Ok(Body::cuboid("B", Vector3::new(x, y, z))?)
}

/// Cylinder about z.
pub(super) fn cylinder(radius: f64, half_height: f64) -> Result<Body, ZooError> {
    Ok(Body::cylinder("cylinder", radius, half_height)?)
}

/// The body of a polynomial in units of `sizes` along the axes.
fn certified(name: &str, sizes: Vector3<f64>, polynomial: Polynomial) -> Result<Body, ZooError> {
    let gram = certificate(&polynomial)?;
    let linear = Matrix3::from_diagonal(&sizes.map(|size| 1.0 / size));
    Ok(Body::new(name, Normalization { center: Vector3::zeros(), linear }, vec![Constraint { polynomial, gram }])?)
}

fn factorial(n: usize) -> f64 {
    (1..=n).map(|i| i as f64).product()
}

fn binomial(n: usize, k: usize) -> f64 {
    factorial(n) / (factorial(k) * factorial(n - k))
}

/// F: bodies of degree 4 and 6 around an L, the corners of two bars: off-centre and not symmetric.
fn fitted() -> Result<Vec<Body>, ZooError> {
    let bars = [([-0.5, -0.15, -0.1], [0.5, 0.15, 0.1]), ([0.3, -0.15, -0.1], [0.5, 0.15, 0.9])];
    let corner = |(low, high): &([f64; 3], [f64; 3]), i: usize| {
        Vector3::from_fn(|k, _| if i >> k & 1 == 1 { high[k] } else { low[k] })
    };
    let points: Vec<_> = bars.iter().flat_map(|bar| (0..8).map(move |i| corner(bar, i))).collect();
    let body = |degree| {
        let options = FitOptions { degree, ..FitOptions::default() };
        Ok(fit(&format!("F{degree}"), &points, &options, &mut |_| ControlFlow::Continue(()))?.body)
    };
    [4, 6].into_iter().map(body).collect()
}

/// One of each kind, of sizes about 1; made once.
pub(super) fn zoo() -> Result<&'static [Body], ZooError> {
    static ZOO: OnceLock<Result<Vec<Body>, ZooError>> = OnceLock::new();
    let make = || {
        let mut zoo = vec![e(1.0, 0.7, 0.4)?, b(0.6, 0.9, 0.3)?, cylinder(0.5, 0.8)?];
        zoo.extend([c(4, 0.5, 1.0)?, c(6, 0.8, 0.3)?, c(8, 1.0, 0.7)?]);
        for degree in [4, 6, 8] {
            zoo.extend([q(degree, 0.8, 0.5, 1.1)?, p(degree, 0.7)?]);
        }
        zoo.extend(fitted()?);
        Ok(zoo)
    };
    ZOO.get_or_init(make).as_deref().map_err(Clone::clone)
}
